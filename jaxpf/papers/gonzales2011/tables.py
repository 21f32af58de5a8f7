"""Figures 8 to 11 as tables."""

import numpy as np

from jaxpf.files.tables import Rows, Table
from jaxpf.papers.gonzales2011.scenes import DYNAMICS, METHODS, Outcomes
from jaxpf.papers.judging.claims import Quantity
from jaxpf.papers.judging.comparison_table import Cell
from jaxpf.papers.judging.estimates import mean_cell, ratio_of


def by_scene(values: np.ndarray) -> np.ndarray:
    """Means ``[S]`` of ``[S, R, T]``, ignoring NaN."""
    return np.nanmean(values, axis=(1, 2))


def gain(ours: np.ndarray, base: np.ndarray, what: str = "") -> Quantity:
    """Reduction relative to PS in per cent: 1 minus the geometric mean of ratios.

    The arithmetic mean of ratios can exceed 1 in either direction of the division.

    Args:
        ours: value per sequence, ``[S]``.
        base: the same for PS.
        what: description for reports.
    """
    ratio = ratio_of(ours, base)

    def interval(level: float) -> tuple[float, float]:
        low, high = ratio.interval(level)
        return 100 * (1 - high), 100 * (1 - low)

    return ratio._replace(value=100 * (1 - ratio.value), interval=interval, what=what)


def tables(outcomes: Outcomes) -> list[Table]:
    """Errors and variances of every cell, and the reduction of SPS relative to PS."""
    tables = []
    for dynamics in DYNAMICS:
        rows: dict[str, Rows] = {name: [] for name in ("error", "variance", "gain")}
        for (motion, parts, particles), outcome in outcomes.items():
            label = f"{motion}, {parts} parts, N = {particles}"
            for name, digits in (("error", 0), ("variance", 1)):
                values = getattr(outcome, name)
                cells = [mean_cell(by_scene(values[dynamics, m]), digits) for m in METHODS]
                rows[name].append((label, cells))
            gains: list[Cell | str] = []
            for name in ("error", "variance"):
                values = {m: by_scene(getattr(outcome, name)[dynamics, m]) for m in METHODS}
                gains += [
                    Cell(None, gain(values[m], values["PS"]).measured(), 1) for m in METHODS[1:]
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
                "Sequence by sequence, with the same seeds; above 0, SPS is better.  One less the "
                "geometric mean of the ratios.",
            ),
        ]
    return tables
