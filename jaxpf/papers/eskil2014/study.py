"""eskil2014 repeated: Eskil, "Factored particle filtering with dependent and constrained partition
dynamics for tracking deformable objects".

The three sequences on synthetic scenes modelled on them, with ablations and common baselines:
figures 3 to 10.  Errors and visibility are ``[T, P]``.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from jaxpf.measures.points import mean_error, points_kept, recoveries
from jaxpf.media import plotting
from jaxpf.papers.checkpoints import Measurements
from jaxpf.papers.eskil2014.scenes import (
    FILTERS,
    FLOW,
    PFFL,
    PROPOSED,
    QUICK,
    SEQUENCES,
    SPOT,
    SPOT_SCENES,
    on_scene,
)
from jaxpf.papers.judging.claims import counted
from jaxpf.papers.paper import Paper
from jaxpf.papers.study import Study, Values

_QUICK_FRAMES = 60
#: A point counts as kept or recovered within this distance, relative to the body's length.
NEAR = 0.1
#: Number of frames after an occlusion within which a point must be recovered.
WITHIN = 30
#: Number of final frames of ``WITHIN`` in which the median distance must be small.
_STAYS = 10
_LAST = slice(-10, None)
#: Bound on most errors of the skydiver relative to his length.
SKYDIVER_MOSTLY = 0.2
#: Frames after which PFFL's curve parts from the proposed method's (figures 7 and 10).
PARTING = {"skydivers": 50, "face": 85}
#: Frame from which SPOT is lost on the skydivers (figure 7).
SPOT_LOST = 75
#: Frames of the fish before PFFL's points drift ("as early as frame 15"), and after its curve parts
#: ("from frame 20"); errors begin with frame 1.
FISH_TOGETHER, FISH_PARTED = slice(0, 14), slice(19, 30)
#: Middle frames of the three blinks in our synthetic face (scenes.face), and the frames after each
#: in which the eye is open again.
BLINKS, _OPEN = (22, 68, 108), range(5, 11)
#: Frames in which the mouth smiles.
SMILE = (56, 95)
_SHOWN = {
    "fish": ("nose", "eye", "dorsal front"),
    "skydivers": ("head", "left hand", "right hand"),
    "face": ("left lip corner", "right lip corner", "profile eye", "profile upper lip"),
}
_NUMBERS = {"fish": (3, 4), "skydivers": (6, 7), "face": (9, 10)}
_COMPARED = (PROPOSED, PFFL, SPOT, FLOW, "PS", "SPS")


def measure_all(seeds: range, quick: bool, measurements: Measurements) -> Study:
    """Run all measurements; the figures show names, visibility and errors by kind of scene."""
    found = {}
    for name in ["platty"] if quick else list(SEQUENCES):
        scene, scale = SEQUENCES[name]
        of_scenes = counted(len(seeds), "scenes")
        measurements.report(f"{name}: {of_scenes}, one run of every method on each")
        filters = QUICK if quick else FILTERS
        shorter = {"num_frames": _QUICK_FRAMES} if quick else {}
        with_spot = seeds[:SPOT_SCENES]
        measured = partial(on_scene, scene, scale, filters, with_spot, shorter)
        found[scene] = measurements.of_scenes(scene, measured, seeds)
    return study_of(found)


def study_of(found: Mapping[str, Mapping[str, np.ndarray]]) -> Study:
    """Rows of all measures, from the arrays ``[S, ...]`` of ``on_scene`` by kind of scene."""
    values: Values = {}
    words: dict[str, str] = {}
    for scene, arrays in found.items():
        names = [str(name) for name in arrays["names"][0]]
        errors = {name: each for name, each in arrays.items() if name not in ("names", "visible")}
        spot = f", of SPOT {len(errors[SPOT])}" if SPOT in errors else ""
        words |= {f"points_{scene}": str(len(names)), f"spot_{scene}": spot}
        for method, of_method in errors.items():
            for of_scene, visible in zip(of_method, arrays["visible"], strict=False):
                for name, value in measures(scene, names, of_scene, visible).items():
                    values.setdefault((name, method, ""), []).append(value)
    return Study(values, found, words)


def measures(
    scene: str, names: Sequence[str], errors: np.ndarray, visible: np.ndarray
) -> dict[str, float]:
    """Name of a measure -> its value of a method on one scene."""
    of_kind = _OF_SCENE[scene](names, errors)
    every = {
        "all frames": _error(errors),
        "while hidden": 100 * mean_error(errors, ~visible),
        "last 10 frames": _error(errors, _LAST),
        "points kept": points_kept(errors, NEAR),
        "recovered (%)": found_again(errors, visible),
    }
    return {f"{scene}: {name}": float(value) for name, value in {**every, **of_kind}.items()}


def _of_fish(names: Sequence[str], errors: np.ndarray) -> dict[str, Any]:
    return {
        "kept": points_kept(errors, NEAR) / errors.shape[-1],
        "final error": _error(errors, _LAST),
        "together": _error(errors, FISH_TOGETHER),
        "parted": _error(errors, FISH_PARTED),
    }


def _of_skydivers(names: Sequence[str], errors: np.ndarray) -> dict[str, Any]:
    checked = _of_points(names, errors, ("head", "left hand", "right hand").__contains__)
    return {
        "peak": errors.mean(axis=1).max(),
        "near": (checked <= SKYDIVER_MOSTLY).all(axis=-1).mean(),
        "before": _error(errors, slice(PARTING["skydivers"])),
        "after": _error(errors, slice(PARTING["skydivers"], None)),
        "late": _error(errors, slice(SPOT_LOST, None)),
    }


def _of_face(names: Sequence[str], errors: np.ndarray) -> dict[str, Any]:
    lip = _of_points(names, errors, "right lip corner".__eq__)
    eyes = _of_points(names, errors, lambda name: "eye" in name)
    after_blinks = [blink + after for blink in BLINKS for after in _OPEN]
    return {
        "before": _error(errors, slice(PARTING["face"])),
        "after": _error(errors, slice(PARTING["face"], None)),
        "smile": 100 * (lip[SMILE[0] + 6 : SMILE[1] - 6].mean() - lip[_LAST].mean()),
        "after blinks": (eyes[after_blinks] <= NEAR).mean(),
    }


_OF_SCENE: Mapping[str, Callable[..., dict[str, Any]]]
_OF_SCENE = {"fish": _of_fish, "skydivers": _of_skydivers, "face": _of_face}


def _error(errors: np.ndarray, frames: slice = slice(None)) -> np.ndarray:
    """Mean error over a range of frames, in % of the length."""
    return 100 * mean_error(errors[frames])


def _of_points(
    names: Sequence[str], errors: np.ndarray, is_chosen: Callable[[str], bool]
) -> np.ndarray:
    return errors[..., [place for place, name in enumerate(names) if is_chosen(name)]]


def found_again(errors: np.ndarray, visible: np.ndarray) -> float:
    """Share of the occlusions after which a point was recovered; NaN without any.

    Points count that reappear and stay visible for ``WITHIN`` frames.  A point is recovered if its
    median distance in the last ten of them is small; being near in a single frame is not enough.
    """
    again = [
        np.median(errors[back + WITHIN - _STAYS : back + WITHIN, point]) <= NEAR
        for point, _, back in recoveries(visible)
        if back + WITHIN <= len(visible) and visible[back : back + WITHIN, point].all()
    ]
    return float(np.mean(again)) if again else math.nan


def figures(study: Study) -> dict[str, Figure]:
    """Figures 3, 6, 9 (errors of single points) and 4, 7, 10 (mean errors) of the paper."""
    drawn = {}
    for scene, arrays in study.shown.items():
        single, mean = _NUMBERS[scene]
        names, proposed = list(arrays["names"][0]), arrays[PROPOSED].mean(axis=0)
        drawn[f"figure_{single}"] = _curves(
            {name: proposed[:, names.index(name)] for name in _SHOWN[scene]},
            arrays["visible"],
            f"{scene}: {PROPOSED}, single points (the paper's figure {single})",
        )
        drawn[f"figure_{mean}"] = _curves(
            {name: arrays[name].mean(axis=(0, 2)) for name in _COMPARED if name in arrays},
            arrays["visible"],
            f"{scene}: mean over all points (the paper's figure {mean})",
            yscale="log",
        )
    return drawn


def _curves(
    series: Mapping[str, np.ndarray], visible: np.ndarray, title: str, yscale: str = "linear"
) -> Figure:
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


PAPER = Paper("eskil2014", measure_all, figures)
