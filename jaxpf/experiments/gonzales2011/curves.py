"""Figures 8 to 11: tables of means, and the curves over time."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from jaxpf.experiments.claims import Measured, student_interval
from jaxpf.experiments.comparison_table import Cell, Table
from jaxpf.experiments.gonzales2011.tracking import DYNAMICS, METHODS, Outcome
from jaxpf.media import plotting

#: (motion, parts, particles) -> outcome.
Outcomes = Mapping[tuple[str, int, int], Outcome]


def by_scene(values: np.ndarray) -> np.ndarray:
    """Means ``[S]`` of ``[S, R, T]``; what is NaN is left out."""
    return np.nanmean(values, axis=(1, 2))


def measured(values: np.ndarray) -> Measured:
    """The mean of sequences' values ``[S]`` with its interval."""
    return Measured(float(np.nanmean(values)), *student_interval(values)(0.95))


def gain(values: Mapping[tuple[str, str], np.ndarray], dynamics: str, method: str) -> np.ndarray:
    """How much less than PS a method has, in per cent of PS, for each sequence ``[S]``."""
    base, other = (by_scene(values[dynamics, name]) for name in ("PS", method))
    return 100 * (1 - other / base)


def error_tables(outcomes: Outcomes) -> list[Table]:
    """Errors and variances of every cell, and what SPS gains on PS."""
    tables = []
    for dynamics in DYNAMICS:
        rows: dict[str, list[Any]] = {name: [] for name in ("error", "variance", "gain")}
        for (motion, parts, particles), outcome in outcomes.items():
            label = f"{motion}, {parts} parts, N = {particles}"
            for name, digits in (("error", 0), ("variance", 1)):
                values = getattr(outcome, name)
                cells = [
                    Cell(None, measured(by_scene(values[dynamics, m])), digits=digits)
                    for m in METHODS
                ]
                rows[name].append((label, cells))
            gains = [
                Cell(None, measured(gain(getattr(outcome, name), dynamics, m)), digits=1)
                for name in ("error", "variance")
                for m in METHODS[1:]
            ]
            rows["gain"].append((label, gains))
        tables += [
            Table(
                f"error_{dynamics}",
                f"Figures 8, 10, 11: sum of corner distances (pixels), {dynamics} dynamics",
                ["", *METHODS],
                rows["error"],
                "Mean over frames and runs; the paper has curves without numbers.",
            ),
            Table(
                f"variance_{dynamics}",
                f"Figures 9, 11: variance of the particle set (pixels^2), {dynamics} dynamics",
                ["", *METHODS],
                rows["variance"],
            ),
            Table(
                f"gain_{dynamics}",
                f"How much less than PS (%), {dynamics} dynamics: error, then variance",
                ["", *(f"{short}, {m}" for short in ("error", "variance") for m in METHODS[1:])],
                rows["gain"],
                "Sequence by sequence, with the same seeds; above 0, SPS is better.",
            ),
        ]
    return tables


def figures(outcomes: Outcomes) -> dict[str, Any]:
    """Curves over time, as in the paper: a column per panel, a row per dynamics."""
    smooth = [key for key in outcomes if key[0] == "smooth"]
    found = {}
    for parts in sorted({key[1] for key in smooth}):
        cells = [key for key in smooth if key[1] == parts]
        found[f"figure_8_{parts}_parts"] = _curves(outcomes, cells, ("error",))
    nine = [key for key in smooth if key[2] == 10] or smooth[:1]
    found["figure_9"] = _curves(outcomes, nine, ("variance",))
    for name, motion, measures in (
        ("figure_10", "strong_start", ("error",)),
        ("figure_11", "erratic", ("error", "variance")),
    ):
        cells = [key for key in outcomes if key[0] == motion]
        if cells:
            found[name] = _curves(outcomes, cells, measures)
    return found


_LABELS = {"error": "sum of corner distances (pixels)", "variance": "variance (pixels$^2$)"}


def _curves(
    outcomes: Outcomes, cells: Sequence[tuple[str, int, int]], measures: Sequence[str]
) -> Any:
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
                values = getattr(outcomes[cell], measure)[dynamics, method]
                curve = np.nanmean(values, axis=(0, 1))
                axis.plot(1 + np.arange(len(curve)), curve, color=colour, label=method, lw=1.2)
            axis.set(title=f"{cell[1]} parts, N = {cell[2]}", ylim=(0, None))
            axis.grid(alpha=0.3)
            if column == 0 or len(measures) > 1:
                axis.set_ylabel(f"{dynamics}\n{_LABELS[measure]}")
            if row == len(DYNAMICS) - 1:
                axis.set_xlabel("frame")
    axes[0, 0].legend(fontsize="x-small")
    return figure
