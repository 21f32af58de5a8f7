"""Figures 2 to 4: samples per target, lost samples and the error of the size."""

from typing import TYPE_CHECKING

import numpy as np

from jaxpf.media import plotting
from jaxpf.papers.study import Study

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def figures(study: Study) -> "dict[str, Figure]":
    """File-name stem -> figure."""
    shown = study.shown
    return {
        "figure_2": figure_2({name: shown[name]["share"] for name in ("without eq. 4", "both")}),
        "figure_3": figure_3({name: shown[name]["astray"] for name in ("neither", "both")}),
        "figure_4": figure_4(shown["both"]["area_ratio"]),
    }


def figure_2(shares: dict[str, np.ndarray]) -> "Figure":
    """Share of samples on target 1 per frame: the first run of every scene."""
    figure, axes = plotting.new_figure(1, 2, figsize=(10, 3.6))
    titles = ("without eq. 4", "with eq. 4")
    for axis, share, title in zip(axes[0], shares.values(), titles, strict=True):
        of_first = 100 * share[:, 0, :, 0].T
        axis.plot(np.arange(1, len(of_first) + 1), of_first, linewidth=0.7)
        axis.set(title=title, xlabel="frame", ylabel="samples on target 1 (%)", ylim=(-2, 102))
    return figure


def figure_3(astray: dict[str, np.ndarray]) -> "Figure":
    """Share of lost samples per frame, mean over runs."""
    figure, axes = plotting.new_figure(figsize=(7, 3.6))
    axis = axes[0, 0]
    for (variant, shares), colour in zip(astray.items(), plotting.colours(2), strict=True):
        curve = 100 * shares.mean(axis=(0, 1))
        axis.plot(np.arange(1, len(curve) + 1), curve, color=colour, label=variant)
    axis.set(xlabel="frame", ylabel="lost samples (%)")
    axis.legend(title="regularising and feedback")
    return figure


def figure_4(ratio: np.ndarray) -> "Figure":
    """Error of the area in six runs, both targets."""
    figure, axes = plotting.new_figure(figsize=(7, 3.6))
    axis = axes[0, 0]
    for run in ratio.reshape(-1, *ratio.shape[2:])[:6]:
        axis.plot(np.arange(1, len(run) + 1), 100 * (run - 1), linewidth=0.7)
    axis.set(xlabel="frame", ylabel="error of the area (%)", ylim=(-100, 200))
    return figure
