"""Tables and figures of the runs on scenes."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from jaxpf.experiments.claims import Measured, student_interval
from jaxpf.experiments.comparison_table import Cell, Table
from jaxpf.experiments.eskil2014 import methods, published
from jaxpf.experiments.eskil2014.tracking import SPOT_SCENES, Outcome
from jaxpf.measures import points as measures

#: A point is kept, or found again, within this share of the body's length.
NEAR = 0.1
#: Frames after an occlusion in which a point is to be found again.
WITHIN = 30

Outcomes = Mapping[str, Outcome]


def by_scene(outcome: Outcome, method: str, measure: Any) -> np.ndarray:
    """``measure(errors [R, T, P], visible [T, P]) -> [R]``, averaged over the runs: ``[S]``."""
    return np.array(
        [
            float(np.mean(measure(errors, visible)))
            for errors, visible in zip(outcome.errors[method], outcome.visible, strict=False)
        ]
    )


def kept(errors: np.ndarray, visible: np.ndarray) -> np.ndarray:
    """Points near their places at the end, of every run."""
    return measures.points_kept(errors, NEAR)


def found_again(errors: np.ndarray, visible: np.ndarray) -> np.ndarray:
    """Share of the ended occlusions after which a point was found again; NaN without any."""
    again = measures.recovered(errors, visible, NEAR, WITHIN)
    if again.shape[-1] == 0:
        return np.full(len(errors), np.nan)
    return again.mean(axis=-1)


def scene_table(outcome: Outcome) -> Table:
    """Every method's errors on one kind of scene."""
    num_points = len(outcome.names)
    rows = []
    for method in outcome.errors:
        in_view = by_scene(outcome, method, measures.mean_error)
        hidden = by_scene(outcome, method, lambda e, v: measures.mean_error(e, ~v))
        last = by_scene(outcome, method, lambda e, v: measures.mean_error(e[:, -10:]))
        ends = by_scene(outcome, method, kept)
        again = 100 * by_scene(outcome, method, found_again)
        proposed = method in (methods.PROPOSED, "eskil2014 as printed")
        known = None
        if outcome.scene == "fish" and method in (methods.PFFL, "PFFL as printed"):
            known = float(published.KEPT_PFFL)
        elif outcome.scene == "fish" and proposed:
            known = float(published.KEPT_PROPOSED)
        rows.append(
            (
                method,
                [
                    _cell(100 * in_view, 1),
                    _cell(100 * hidden, 1),
                    _cell(100 * last, 1),
                    _cell(ends, 1, known),
                    _cell(again, 0),
                ],
            )
        )
    scenes, runs = outcome.errors[next(iter(outcome.errors))].shape[:2]
    return Table(
        f"errors_{outcome.scene}",
        f"{outcome.scene}: mean distance over the body's length (%), {num_points} points; "
        "published | measured",
        ["", "all frames", "while hidden", "last 10 frames", "points kept", "found again (%)"],
        rows,
        f"{scenes} scenes with {runs} runs each; the scenes are the units of the intervals.  A "
        f"point is kept if its median distance in the last 10 frames is at most {NEAR:g} of the "
        f"body's length, and found again if it comes that near within {WITHIN} frames of its "
        "return.  SPOT, Lucas-Kanade and not moving are deterministic; SPOT "
        f"was run on the first {SPOT_SCENES} scenes at most.",
    )


def _cell(values: np.ndarray, digits: int, known: float | None = None) -> Cell:
    values = np.asarray(values, float)
    values = values[np.isfinite(values)]
    if len(values) == 0:
        return Cell(known, None, digits)
    low, high = student_interval(values)(0.95) if len(values) > 1 else (math.nan, math.nan)
    return Cell(known, Measured(float(values.mean()), low, high), digits)


_SHOWN = {
    "fish": ("nose", "eye", "dorsal front"),
    "skydivers": ("head", "left hand", "right hand"),
    "face": ("left lip corner", "right lip corner", "profile eye", "profile upper lip"),
}
_NUMBERS = {"fish": (3, 4), "skydivers": (6, 7), "face": (9, 10)}
_COMPARED = (methods.PROPOSED, methods.PFFL, methods.SPOT, methods.FLOW, "PS", "SPS")


def figures(outcomes: Outcomes) -> dict[str, Any]:
    """Figures 1, 3, 6, 9 (errors of single points) and 4, 7, 10 (mean errors) of the paper."""
    from matplotlib.figure import Figure

    drawn: dict[str, Any] = {"figure_1": _potential()}
    for scene, outcome in outcomes.items():
        single, mean = _NUMBERS[scene]
        times = np.arange(1, outcome.visible.shape[1] + 1)
        figure = Figure(figsize=(8, 3.5), layout="constrained")
        axes = figure.subplots()
        for name in _SHOWN[scene]:
            error = outcome.errors[methods.PROPOSED][..., outcome.names.index(name)]
            axes.plot(times, error.mean(axis=(0, 1)), label=name)
        _finish(axes, f"{scene}: {methods.PROPOSED}, single points (the paper's figure {single})")
        drawn[f"figure_{single}"] = figure
        figure = Figure(figsize=(8, 3.5), layout="constrained")
        axes = figure.subplots()
        for method in _COMPARED:
            if method in outcome.errors:
                error = outcome.errors[method].mean(axis=(0, 1, 3))
                axes.plot(times, error, label=method)
        axes.set_yscale("log")
        _finish(axes, f"{scene}: mean over all points (the paper's figure {mean})")
        drawn[f"figure_{mean}"] = figure
    return drawn


def _finish(axes: Any, title: str) -> None:
    axes.set_xlabel("frame")
    axes.set_ylabel("distance / body length")
    axes.set_title(title, fontsize=10)
    axes.legend(fontsize=8, ncols=2)
    axes.grid(alpha=0.3)


def _potential() -> Any:
    """Figure 1: the shape function of one point of the fish, over the picture's plane."""
    from matplotlib.figure import Figure

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
    figure = Figure(figsize=(6, 4.5), layout="constrained")
    axes = figure.subplots()
    image = axes.imshow(np.exp(value).reshape(x.shape), extent=(-120, 180, 80, -80), cmap="gray")
    axes.plot(*places.T, ".", color="tab:orange")
    axes.plot(*places[point], "o", color="tab:red", fillstyle="none")
    axes.set_title("The shape function of the nose, scale .2 (the paper's figure 1)", fontsize=10)
    figure.colorbar(image, ax=axes)
    return figure
