"""Measures of the experiment, by the names in ``claims.csv``, and figures that are computed.

Variants are methods under one of the dynamics; cases are numbers of particles and parts.
"""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from jaxpf.measures import particle_sets
from jaxpf.ordering import named
from jaxpf.papers.gonzales2011.published import (
    FIGURE_8_PARTICLES,
    FIGURE_8_PARTS,
    FIGURE_9_PARTICLES,
    FIGURE_10_PARTICLES,
    FIGURE_11_PARTICLES,
    FIGURE_11_PARTS,
    PARTS,
)
from jaxpf.papers.gonzales2011.scenes import Outcomes
from jaxpf.papers.judging.claims import Quantity, computed
from jaxpf.papers.judging.measures import Measure


def by_scene(outcomes: Outcomes, field: str, variant: str) -> dict[str, np.ndarray]:
    """Means ``[S]`` over the frames of every cell, ignoring NaN."""
    return {
        f"{motion}, {parts} parts, N = {particles}": np.nanmean(outcome.of(field, variant), axis=1)
        for (motion, parts, particles), outcome in outcomes.items()
    }


def _figure(
    field: str, motion: str, parts: Sequence[int], particles: Sequence[int], case: str
) -> Measure:
    """The measured cells of a figure."""

    def values(outcomes: Outcomes, variant: str) -> dict[str, np.ndarray]:
        known = by_scene(outcomes, field, variant)
        cells = {
            case.format(parts=p, particles=n): f"{motion}, {p} parts, N = {n}"
            for n in particles
            for p in parts
        }
        return {what: known[cell] for what, cell in cells.items() if cell in known}

    return Measure(values, "gain")


_EACH, _PARTS = "N = {particles}, {parts} parts", "{parts} parts"
_ERRATIC = ("erratic", [FIGURE_11_PARTS], [FIGURE_11_PARTICLES], _PARTS)

MEASURES: Mapping[str, Measure] = {
    "error": Measure(lambda outcomes, variant: by_scene(outcomes, "error", variant), "gain"),
    "variance": Measure(
        lambda outcomes, variant: by_scene(outcomes, "variance", variant), "gain", 1
    ),
    "figure 8": _figure("error", "smooth", FIGURE_8_PARTS, FIGURE_8_PARTICLES, _EACH),
    "figure 9": _figure("variance", "smooth", FIGURE_8_PARTS, [FIGURE_9_PARTICLES], _PARTS),
    "figure 10": _figure("error", "strong_start", PARTS, [FIGURE_10_PARTICLES], _PARTS),
    "figure 11, error": _figure("error", *_ERRATIC),
    "figure 11, variance": _figure("variance", *_ERRATIC),
}


def computed_quantities() -> dict[str, list[Quantity]]:
    """Figures that need no measurement."""
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
    for num_parts in FIGURE_8_PARTS:
        tree = [-1 if part == 0 else max(part - 2, 0) for part in range(num_parts)]
        ps, sps = (
            int(particle_sets.resamplings_per_frame(named(method, tree).resample_after))
            for method in ("ps", "sps")
        )
        figures.append(computed(ps / sps, f"{num_parts} parts, {ps} / {sps}"))
    return figures
