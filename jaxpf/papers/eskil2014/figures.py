"""Figures 3 to 10: errors over time."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from jaxpf.media import plotting
from jaxpf.papers.eskil2014 import methods
from jaxpf.papers.study import Study

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_SHOWN = {
    "fish": ("nose", "eye", "dorsal front"),
    "skydivers": ("head", "left hand", "right hand"),
    "face": ("left lip corner", "right lip corner", "profile eye", "profile upper lip"),
}
_NUMBERS = {"fish": (3, 4), "skydivers": (6, 7), "face": (9, 10)}
_COMPARED = (methods.PROPOSED, methods.PFFL, methods.SPOT, methods.FLOW, "PS", "SPS")


def figures(study: Study) -> "dict[str, Figure]":
    """Figures 3, 6, 9 (errors of single points) and 4, 7, 10 (mean errors) of the paper."""
    drawn = {}
    for scene, arrays in study.shown.items():
        single, mean = _NUMBERS[scene]
        names, proposed = list(arrays["names"][0]), arrays[methods.PROPOSED].mean(axis=(0, 1))
        drawn[f"figure_{single}"] = _curves(
            {name: proposed[:, names.index(name)] for name in _SHOWN[scene]},
            arrays["visible"],
            f"{scene}: {methods.PROPOSED}, single points (the paper's figure {single})",
        )
        drawn[f"figure_{mean}"] = _curves(
            {name: arrays[name].mean(axis=(0, 1, 3)) for name in _COMPARED if name in arrays},
            arrays["visible"],
            f"{scene}: mean over all points (the paper's figure {mean})",
            yscale="log",
        )
    return drawn


def _curves(
    series: Mapping[str, np.ndarray], visible: np.ndarray, title: str, yscale: str = "linear"
) -> "Figure":
    """Errors over time, on grey that darkens with the share of hidden points."""
    figure, axes = plotting.new_figure(figsize=(8, 3.5))
    axis = axes[0, 0]
    for name, errors in series.items():
        axis.plot(np.arange(1, len(errors) + 1), errors, label=name)
    for frame, share in enumerate(1 - visible.mean(axis=(0, 2)), start=1):
        if share > 0:
            axis.axvspan(frame - 0.5, frame + 0.5, color="black", alpha=0.5 * share, lw=0)
    axis.set(
        xlabel="frame (grey: share of hidden points)",
        ylabel="distance / body length",
        yscale=yscale,
    )
    axis.set_title(title, fontsize=10)
    axis.legend(fontsize=8, ncols=2)
    axis.grid(alpha=0.3)
    return figure
