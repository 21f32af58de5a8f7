"""Baseline trackers: functions of the scene that return boxes or points.

A baseline starts from the truth in the first frame; a lost object stays at its last position.  To
add one, write a function of the frames and one box, and register it in ``BASELINES``, or of the
frames and all points, in ``POINT_BASELINES``.

OpenCV's trackers use its default settings: MIL (Babenko, Yang and Belongie 2009), CSRT (Lukezic
et al. 2017) and KCF (Henriques et al. 2015); the last two are in opencv-contrib.  OpenCV seeds
MIL's random samples from the clock, so MIL's boxes differ between evaluations.  Its networks Vit
and Nano take their models from files of the user's.  dlib's is a correlation filter over
translation and scale (Danelljan et al. 2014), in the package dlib-bin.
"""

import dataclasses
import functools
import importlib.util
from collections.abc import Callable, Collection, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from jaxpf.contract.errors import InputError, import_extra
from jaxpf.evaluation.baselines.optical_flow import follow_points
from jaxpf.evaluation.baselines.spot import spot

if TYPE_CHECKING:
    from scenes import Scene

_SHIFTS = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 20, 0.5)


@dataclasses.dataclass(frozen=True)
class Baseline:
    """A baseline by name: a picklable function of the scene."""

    name: str

    def __call__(self, scene: "Scene") -> np.ndarray:
        """Track the scene; returns boxes ``[T, P, 4]`` or points ``[T, P, 2]``, start included.

        Raises:
            InputError: the installed OpenCV lacks the tracker, or the tracker fails.
        """
        if self.name in POINT_BASELINES:
            if "points" not in scene.extras:
                raise InputError(
                    f"the baseline {self.name!r} tracks points, and {scene.name!r} has none; leave "
                    "it out."
                )
            start = np.asarray(scene.extras["points"][0], np.float64)
            return np.concatenate([start[None], POINT_BASELINES[self.name](scene.frames, start)])
        kind, *files = self.name.split(":")
        try:
            tracks = [BASELINES[kind](*files, scene.frames, box) for box in scene.boxes[0]]
        except cv2.error as error:
            reason = " ".join(str(error).split())
            raise InputError(
                f"the baseline {self.name!r} fails on this scene: {reason}."
            ) from error
        return np.stack(tracks, axis=1)


def baselines(names: Collection[str]) -> dict[str, Baseline]:
    """Baselines by name, for ``Plan(trackers=...)``.

    Raises:
        InputError: a name is unknown.
    """
    known = [*BASELINES, *POINT_BASELINES]
    for name in names:
        kind, *files = name.split(":")
        wanted = _NETWORKS.get(kind, ())
        if kind not in known:
            raise InputError(
                f"baseline {name!r} is unknown; choose from {', '.join(known)}, or all."
            )
        if len(files) != len(wanted) or not all(Path(file).is_file() for file in files):
            form = ":".join([kind, *(f"{each.upper()}.onnx" for each in wanted)])
            raise InputError(f"baseline {name!r} must be {form}, with files that exist.")
    kinds = [name.partition(":")[0] for name in names]
    for kind in kinds:
        if kinds.count(kind) > 1:
            raise InputError(f"baseline {kind!r} is asked for twice; give one file at a time.")
    return {kind: Baseline(name) for kind, name in zip(kinds, names, strict=True)}


def available() -> list[str]:
    """The names of all baselines for boxes that are installed, and need no files."""
    missing = {name for name, maker in _OPENCV.items() if _maker(maker) is None} | {*_NETWORKS}
    if importlib.util.find_spec("dlib") is None:
        missing.add("dlib")
    return [name for name in BASELINES if name not in missing]


def _still(frames: np.ndarray, box: np.ndarray) -> np.ndarray:
    """A box that never moves."""
    return np.tile(box, (len(frames), 1))


def _mean_shift(frames: np.ndarray, box: np.ndarray) -> np.ndarray:
    """Mean shift on the back projection of hue and saturation (Bradski 1998), with fixed size."""
    x, y, w, h = window = _whole(box, frames)
    hsv = cv2.cvtColor(frames[0], cv2.COLOR_RGB2HSV)
    patch = np.ascontiguousarray(hsv[y : y + h, x : x + w])
    bins, ranges = [32, 16], [0, 180, 0, 256]
    histogram = cv2.calcHist([patch], [0, 1], None, bins, ranges)
    cv2.normalize(histogram, histogram, 0, 255, cv2.NORM_MINMAX)
    track = [box]
    for frame in frames[1:]:
        hsv = cv2.cvtColor(frame, cv2.COLOR_RGB2HSV)
        likeness = cv2.calcBackProject([hsv], [0, 1], histogram, ranges, 1)
        _, (x, y, *_) = cv2.meanShift(likeness, window, _SHIFTS)
        # OpenCV clips the window at the frame's edge; restore its size.
        window = _whole(np.array([x, y, w, h]), frames)
        track.append(np.array(window))
    return np.array(track, np.float64)


def _opencv(name: str, *given: Any) -> np.ndarray:
    """Track one box with one of OpenCV's trackers; ``given``: model files, frames and the box."""
    *files, frames, box = given
    if (maker := _maker(name)) is None:
        raise InputError(
            f"the baseline {name.lower()!r} is missing in this OpenCV; put "
            "opencv-contrib-python-headless in the place of opencv-python-headless."
        )
    x, y, width, height = _whole(box, frames)
    if name == "MIL" and not _has_features(width - 1, height - 1):
        raise InputError(
            f"the baseline 'mil' finds no features in a box of {width}x{height} pixels; give boxes "
            "of 5x5 pixels or more, or leave it out."
        )
    settings = []
    if files:
        settings = [getattr(cv2, f"Tracker{name}_Params")()]
        for field, file in zip(_NETWORKS[name.lower()], files, strict=True):
            setattr(settings[0], field, file)
    tracker = maker(*settings)
    tracker.init(_bgr(frames[0]), (x, y, width, height))
    track = [np.asarray(box, np.float64)]
    for frame in frames[1:]:
        is_tracked, window = tracker.update(_bgr(frame))
        track.append(np.array(window, np.float64) if is_tracked else track[-1])
    return np.stack(track)


def _dlib(frames: np.ndarray, box: np.ndarray) -> np.ndarray:
    """Track one box with dlib's correlation tracker."""
    dlib = import_extra("dlib", "the baseline 'dlib' needs dlib", "dlib-bin")
    x, y, width, height = _whole(box, frames)
    tracker, track = dlib.correlation_tracker(), [np.asarray(box, np.float64)]
    # dlib's rectangles end at their last pixel.
    tracker.start_track(frames[0], dlib.rectangle(x, y, x + width - 1, y + height - 1))
    for frame in frames[1:]:
        tracker.update(frame)
        at = tracker.get_position()
        track.append(np.array([at.left(), at.top(), at.width(), at.height()]))
    return np.stack(track)


def _has_features(width: int, height: int) -> bool:
    """Whether OpenCV can draw one of MIL's features; otherwise it draws for ever.

    Features have an area of at least 9 pixels and two equal halves.
    """
    return max(width // 2 * 2 * height, width * (height // 2 * 2)) >= 9


def _maker(name: str) -> Callable[[], Any] | None:
    """The function that makes one of OpenCV's trackers; None if it is not installed."""
    places = (cv2, getattr(cv2, "legacy", None))
    makers = (getattr(place, f"Tracker{name}_create", None) for place in places)
    return next(filter(None, makers), None)


def _whole(box: Sequence[float] | np.ndarray, frames: np.ndarray) -> tuple[int, int, int, int]:
    """Round a box to whole pixels, and shift and clip it into the frame."""
    limits = np.array(frames.shape[2:0:-1])
    size = np.clip(np.rint(box[2:]), 1, limits).astype(int)
    corner = np.clip(np.rint(box[:2]), 0, limits - size).astype(int)
    return (int(corner[0]), int(corner[1]), int(size[0]), int(size[1]))


def _bgr(frame: np.ndarray) -> np.ndarray:
    return cv2.cvtColor(frame, cv2.COLOR_RGB2BGR)


#: Baseline -> OpenCV's name of its tracker.
_OPENCV = {"mil": "MIL", "csrt": "CSRT", "kcf": "KCF", "vit": "Vit", "nano": "Nano"}
#: Those that are networks -> the files that they need, by OpenCV's names.
_NETWORKS = {"vit": ("net",), "nano": ("backbone", "neckhead")}
#: Name -> function from frames ``[T, H, W, 3]`` and a box ``[4]`` to boxes ``[T, 4]``; files of a
#: network come first.
BASELINES: dict[str, Callable[..., np.ndarray]] = {
    **{name: functools.partial(_opencv, of_opencv) for name, of_opencv in _OPENCV.items()},
    "dlib": _dlib,
    "meanshift": _mean_shift,
    "still": _still,
}
#: Name -> function from frames ``[T, H, W, 3]`` and points ``[P, 2]`` to ``[T - 1, P, 2]``.
POINT_BASELINES: dict[str, Callable[[np.ndarray, np.ndarray], np.ndarray]] = {
    "spot": spot,
    "flow": lambda frames, points: follow_points(frames, points)[0],
}
