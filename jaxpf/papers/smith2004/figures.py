"""Figure 4."""

from typing import TYPE_CHECKING

import numpy as np

from jaxpf.media import plotting
from jaxpf.papers.smith2004.scenes import NUM_OBJECTS, SHARPNESS, Outcome, order_name, shifted
from jaxpf.papers.study import Study

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def figures(study: Study) -> "dict[str, Figure]":
    """File-name stem -> figure."""
    return {"figure_4": figure_4(study.shown)}


def figure_4(outcome: Outcome) -> "Figure":
    """Uniqueness and effective dynamics in u and v for all objects, as in the paper."""
    rows = ["Non-PS", order_name(shifted(0)), order_name(shifted(1)), "DPS", "SPS"]
    figure, axes = plotting.new_figure(len(rows), 3, figsize=(10, 10))
    objects = np.arange(1, NUM_OBJECTS + 1)
    top = 100 * float(np.nanmax(outcome.dynamics[:, :, 0].mean(axis=0))) * 1.05
    for row, name in enumerate(rows):
        place = outcome.names.index(name)
        series = [
            ("uniqueness", outcome.uniqueness[:, place, 0], 105.0),
            ("effective dynamics, u", outcome.dynamics[:, place, 0, :, 0], top),
            ("effective dynamics, v", outcome.dynamics[:, place, 0, :, 1], top),
        ]
        for column, (title, values, limit) in enumerate(series):
            axis = axes[row, column]
            axis.bar(objects, 100 * values.mean(axis=0), color=plotting.colours(NUM_OBJECTS))
            axis.set(ylim=(0, limit), xticks=objects)
            axis.grid(axis="y", alpha=0.3)
            if row == 0:
                axis.set_title(f"{title} (%)")
            if column == 0:
                axis.set_ylabel(name)
    for axis in axes[-1]:
        axis.set_xlabel("object")
    figure.suptitle(
        f"Figure 4 repeated: sharpness {SHARPNESS[0]:g}; effective dynamics is the standard "
        "deviation of the particles over the process noise"
    )
    return figure
