"""Figures 8 to 11: curves over time."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from jaxpf.media import plotting
from jaxpf.papers.gonzales2011.scenes import DYNAMICS, METHODS, Curves
from jaxpf.papers.study import Study

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def figures(study: Study) -> "dict[str, Figure]":
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
) -> "Figure":
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
