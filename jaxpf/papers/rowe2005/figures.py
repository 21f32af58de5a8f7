"""Figures 2 to 4: samples per target, lost samples and the error of the size."""

from typing import Any

import numpy as np

from jaxpf.media import plotting
from jaxpf.papers.rowe2005.scenes import Measurement, Outcome


def figures(measured: Measurement) -> dict[str, Any]:
    """File-name stem -> figure."""
    return {
        "figure_2": figure_2(measured.outcome),
        "figure_3": figure_3(measured.outcome),
        "figure_4": figure_4(measured.outcome),
    }


def figure_2(outcome: Outcome) -> Any:
    """Share of samples on target 1 per frame: the first run of every scene."""
    figure, axes = plotting.new_figure(1, 2, figsize=(10, 3.6))
    for axis, variant, title in zip(
        axes[0], ("without eq. 4", "both"), ("without eq. 4", "with eq. 4"), strict=True
    ):
        shares = 100 * outcome.share[outcome.of(variant), :, 0, :, 0]
        axis.plot(np.arange(1, shares.shape[1] + 1), shares.T, linewidth=0.7)
        axis.set(title=title, xlabel="frame", ylabel="samples on target 1 (%)", ylim=(-2, 102))
    return figure


def figure_3(outcome: Outcome) -> Any:
    """Share of lost samples per frame, mean over runs."""
    figure, axes = plotting.new_figure(figsize=(7, 3.6))
    axis = axes[0, 0]
    for variant, colour in zip(("neither", "both"), plotting.colours(2), strict=True):
        astray = 100 * outcome.astray[outcome.of(variant)].mean(axis=(0, 1))
        axis.plot(np.arange(1, len(astray) + 1), astray, color=colour, label=variant)
    axis.set(xlabel="frame", ylabel="lost samples (%)")
    axis.legend(title="regularising and feedback")
    return figure


def figure_4(outcome: Outcome) -> Any:
    """Error of the area in six runs, both targets."""
    figure, axes = plotting.new_figure(figsize=(7, 3.6))
    axis = axes[0, 0]
    ratio = outcome.area_ratio[outcome.of("both")]
    ratio = ratio.reshape(-1, *ratio.shape[2:])[:6]
    for run in ratio:
        axis.plot(np.arange(1, len(run) + 1), 100 * (run - 1), linewidth=0.7)
    axis.set(xlabel="frame", ylabel="error of the area (%)", ylim=(-100, 200))
    return figure
