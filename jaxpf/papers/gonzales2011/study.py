"""gonzales2011 repeated: Gonzales, Dubuisson and Nguyen, "Simultaneous partitioned sampling for
articulated object tracking", ACIVS 2011.

Figures 8 to 11 on the scene ``articulated``, for PS and for SPS with the paper's swap,
with the unbiased swap and without a swap, under the paper's dynamics and under dynamics that couple
the parts.
"""

import itertools
import math
from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from jaxpf.measures import particle_sets
from jaxpf.media import plotting
from jaxpf.ordering import named
from jaxpf.papers.checkpoints import Measurements
from jaxpf.papers.gonzales2011.scenes import DYNAMICS, METHODS, VARIANTS, Curves, measure
from jaxpf.papers.judging.claims import counted
from jaxpf.papers.judging.estimates import Quantity, computed
from jaxpf.papers.paper import Paper
from jaxpf.papers.study import Study, Values

FRAMES = 300
#: Measure of a claim -> field, motion, and numbers of parts and of particles of a figure's cells.
FIGURES = {
    "figure 8": ("error", "smooth", (7, 9), (2, 5, 10, 20, 30, 40)),
    "figure 9": ("variance", "smooth", (7, 9), (10,)),
    "figure 10": ("error", "strong_start", (3, 5, 7, 9, 11), (20,)),
    "figure 11, error": ("error", "erratic", (5,), (10,)),
    "figure 11, variance": ("variance", "erratic", (5,), (10,)),
}
#: Frames of a figure in which a strong start is strong (``Articulated.strong_frames``).
START = {"figure 10": slice(0, 60)}


def measure_all(seeds: range, quick: bool, measurements: Measurements) -> Study:
    """Run all measurements; the quick ones are of fewer cells and frames."""
    measurements.report(f"{counted(len(seeds), 'sequences')}, one run of 8 trackers on each")
    if quick:
        cells = [("smooth", 5, (5, 10)), ("erratic", 5, (10,))]
        return study_of(measure(cells, seeds, 40, measurements))
    figures = (FIGURES[name] for name in ("figure 8", "figure 10", "figure 11, error"))
    every = [(motion, parts, counts) for _, motion, sizes, counts in figures for parts in sizes]
    return study_of(measure(every, seeds, FRAMES, measurements))


def study_of(curves: Curves) -> Study:
    """Rows of the means over frames: of every cell, and again by the paper's figures."""
    values: Values = {}
    for (motion, parts, number), curve in curves.items():
        for (field, variant), each in curve.items():
            case = f"{motion}, {parts} parts, N = {number}"
            values[field, variant, case] = np.nanmean(each, axis=1)
    for name, (field, motion, counts, particles) in FIGURES.items():
        for number, parts, variant in itertools.product(particles, counts, VARIANTS):
            if (cell := curves.get((motion, parts, number))) is not None:
                shown = cell[field, variant][:, START.get(name, slice(None))]
                several = f"N = {number}, " if len(particles) > 1 else ""
                values[name, variant, f"{several}{parts} parts"] = np.nanmean(shown, axis=1)
    return Study(values, shown=curves)


def computed_quantities() -> dict[str, list[Quantity]]:
    """Key of a claim -> its figures."""
    growth = [computed(sorted_evidence(number), f"N = {number}") for number in (2, 10, 100)]
    return {"resamplings": resamplings(), "unaltered": growth}


def sorted_evidence(num_particles: int) -> float:
    """Mean evidence estimate of the sorted swap over the exact evidence, over all draws.

    The particles share a parent; each of their two arms fits (likelihood 1) or not (0), with equal
    chances, so that the evidence is 1/4.  Sorted, as many particles fit as arms of the rarer side:
    4 E[min(L, R)] / N with binomial L and R, which is 1.25 for two particles and grows to 2.
    """
    counts = np.arange(num_particles + 1)
    chances = [math.comb(num_particles, count) / 2**num_particles for count in counts]
    fitting = np.minimum.outer(counts, counts)
    return float(4 * np.einsum("i,j,ij", chances, chances, fitting) / num_particles)


def resamplings() -> list[Quantity]:
    """Ratio of PS's to SPS's number of resamplings per frame."""
    figures = []
    for num_parts in FIGURES["figure 8"][2]:
        tree = [-1 if part == 0 else max(part - 2, 0) for part in range(num_parts)]
        ps, sps = (
            int(particle_sets.resamplings_per_frame(named(method, tree).resample_after))
            for method in ("ps", "sps")
        )
        figures.append(computed(ps / sps, f"{num_parts} parts, {ps} / {sps}"))
    return figures


def figures(study: Study) -> dict[str, Figure]:
    """Curves over time, as in the paper: one column per panel, one row per dynamics."""
    outcomes: Curves = study.shown
    smooth = [key for key in outcomes if key[0] == "smooth"]
    drawn = {}
    for parts in sorted({key[1] for key in smooth}):
        cells = [key for key in smooth if key[1] == parts]
        drawn[f"figure_8_{parts}_parts"] = _curves(outcomes, cells, ("error",))
    nine = [key for key in smooth if key[2] == 10] or smooth[:1]
    drawn["figure_9"] = _curves(outcomes, nine, ("variance",))
    for name, motion, measures in (
        ("figure_10", "strong_start", ("error",)),
        ("figure_11", "erratic", ("error", "variance")),
    ):
        cells = [key for key in outcomes if key[0] == motion]
        if cells:
            drawn[name] = _curves(outcomes, cells, measures)
    return drawn


_LABELS = {"error": "sum of corner distances (pixels)", "variance": "variance (pixels$^2$)"}


def _curves(
    outcomes: Curves, cells: Sequence[tuple[str, int, int]], measures: Sequence[str]
) -> Figure:
    columns = len(cells) * len(measures)
    figure, axes = plotting.new_figure(
        len(DYNAMICS), columns, figsize=(1.5 + 3.1 * columns, 5.6), share_x=True
    )
    colours = plotting.colours(len(METHODS))
    for row, dynamics in enumerate(DYNAMICS):
        for column in range(columns):
            cell, measure = cells[column // len(measures)], measures[column % len(measures)]
            axis = axes[row, column]
            for method, colour in zip(METHODS, colours, strict=True):
                curve = np.nanmean(outcomes[cell][measure, f"{method}, {dynamics}"], axis=0)
                axis.plot(1 + np.arange(len(curve)), curve, color=colour, label=method, lw=1.2)
            axis.set(title=f"{cell[1]} parts, N = {cell[2]}", ylim=(0, None))
            axis.grid(alpha=0.3)
            if column == 0 or len(measures) > 1:
                axis.set_ylabel(f"{dynamics}\n{_LABELS[measure]}")
            if row == len(DYNAMICS) - 1:
                axis.set_xlabel("frame")
    axes[0, 0].legend(fontsize="x-small")
    return figure


PAPER = Paper("gonzales2011", measure_all, figures, computed_quantities)
