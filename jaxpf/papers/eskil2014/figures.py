"""Figure 1, and figures 3 to 10: errors over time."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from jaxpf.media import plotting
from jaxpf.papers.eskil2014 import methods
from jaxpf.papers.eskil2014.measure import Measurement
from jaxpf.papers.eskil2014.scenes import Outcome

_SHOWN = {
    "fish": ("nose", "eye", "dorsal front"),
    "skydivers": ("head", "left hand", "right hand"),
    "face": ("left lip corner", "right lip corner", "profile eye", "profile upper lip"),
}
_NUMBERS = {"fish": (3, 4), "skydivers": (6, 7), "face": (9, 10)}
_COMPARED = (methods.PROPOSED, methods.PFFL, methods.FLOW, "PS", "SPS")


def figures(measured: Measurement) -> dict[str, Any]:
    """File-name stem -> figure."""
    return curves(measured.outcomes)


def curves(outcomes: Mapping[str, Outcome]) -> dict[str, Any]:
    """Figures 1, 3, 6, 9 (errors of single points) and 4, 7, 10 (mean errors) of the paper."""
    drawn: dict[str, Any] = {"figure_1": _potential()}
    for scene, outcome in outcomes.items():
        single, mean = _NUMBERS[scene]
        proposed = outcome.errors[methods.PROPOSED].mean(axis=(0, 1))
        drawn[f"figure_{single}"] = _curves(
            {name: proposed[:, outcome.names.index(name)] for name in _SHOWN[scene]},
            f"{scene}: {methods.PROPOSED}, single points (the paper's figure {single})",
        )
        drawn[f"figure_{mean}"] = _curves(
            {
                method: outcome.errors[method].mean(axis=(0, 1, 3))
                for method in _COMPARED
                if method in outcome.errors
            },
            f"{scene}: mean over all points (the paper's figure {mean})",
            yscale="log",
        )
    return drawn


def _curves(series: Mapping[str, np.ndarray], title: str, yscale: str = "linear") -> Any:
    figure, axes = plotting.new_figure(figsize=(8, 3.5))
    axis = axes[0, 0]
    for name, errors in series.items():
        axis.plot(np.arange(1, len(errors) + 1), errors, label=name)
    axis.set(xlabel="frame", ylabel="distance / body length", yscale=yscale)
    axis.set_title(title, fontsize=10)
    axis.legend(fontsize=8, ncols=2)
    axis.grid(alpha=0.3)
    return figure


def _potential() -> Any:
    """Figure 1: the shape function of one point of the fish, over the image plane."""
    from jaxpf.filters.factored.shape import log_shape, reference_distances
    from scenes.fish import POINTS

    places = np.array(list(POINTS.values()), np.float32)
    point = list(POINTS).index("nose")
    x, y = np.meshgrid(np.linspace(-120, 180, 301), np.linspace(-80, 80, 161))
    plane = np.stack([x.ravel(), y.ravel()]).astype(np.float32)
    everywhere = np.broadcast_to(plane[:, None], (2, len(places), x.size))
    value = np.asarray(
        log_shape(everywhere, places.T, reference_distances(places), 0.2, "relative")
    )[point]
    figure, ((axes,),) = plotting.new_figure(figsize=(6, 4.5))
    image = axes.imshow(np.exp(value).reshape(x.shape), extent=(-120, 180, 80, -80), cmap="gray")
    axes.plot(*places.T, ".", color="tab:orange")
    axes.plot(*places[point], "o", color="tab:red", fillstyle="none")
    axes.set_title("The shape function of the nose, scale .2 (the paper's figure 1)", fontsize=10)
    figure.colorbar(image, ax=axes)
    return figure
