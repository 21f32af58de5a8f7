"""Measures of the experiment, by the names in ``claims.csv``; variants are methods."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from jaxpf.measures import points as measures
from jaxpf.papers.eskil2014 import published
from jaxpf.papers.eskil2014.scenes import Outcome
from jaxpf.papers.judging.measures import Measure

#: A point counts as kept or recovered within this distance, relative to the body's length.
NEAR = 0.1
#: Number of frames after an occlusion within which a point must be recovered.
WITHIN = 30
#: Number of final frames of ``WITHIN`` in which the median distance must be small.
_STAYS = 10
#: Frames after the middle of a blink in which the eye is open again.
_OPEN = range(5, 11)

#: Function of errors ``[R, T, P]`` and visibility ``[T, P]`` -> ``[R]``.
OfRuns = Callable[[np.ndarray, np.ndarray], Any]


def by_scene(outcome: Outcome, method: str, measure: OfRuns) -> np.ndarray:
    """A measure averaged over runs: ``[S]``."""
    return np.array(
        [
            float(np.mean(measure(errors, visible)))
            for errors, visible in zip(outcome.errors[method], outcome.visible, strict=False)
        ]
    )


def found_again(errors: np.ndarray, visible: np.ndarray) -> np.ndarray:
    """Share of the ``ended_occlusions`` after which a point was recovered; NaN without any.

    A point is recovered if its median distance in the last ten of ``WITHIN`` frames is small; being
    near in a single frame is not enough.
    """
    again = [
        np.median(errors[:, back + WITHIN - _STAYS : back + WITHIN, point], axis=1) <= NEAR
        for point, back in ended_occlusions(visible)
    ]
    return np.mean(again, axis=0) if again else np.full(len(errors), np.nan)


def ended_occlusions(visible: np.ndarray) -> list[tuple[int, int]]:
    """Points that reappear and stay visible for ``WITHIN`` frames, with the frame."""
    return [
        (point, back)
        for point, _, back in measures.recoveries(visible)
        if back + WITHIN <= len(visible) and visible[back : back + WITHIN, point].all()
    ]


def _values(
    scene: str, measure: OfRuns, points: str | tuple[str, ...] = "", least: int = 0
) -> Callable[[Mapping[str, Outcome], str], np.ndarray]:
    """A measure on one kind of scene, of all points or of those whose names contain a text.

    Scenes of at most ``least`` frames count as not measured.
    """

    def values(outcomes: Mapping[str, Outcome], method: str) -> np.ndarray:
        outcome = outcomes[scene]
        if outcome.visible.shape[1] <= least:
            raise KeyError(f"{scene} has too few frames")
        chosen = [
            number
            for number, name in enumerate(outcome.names)
            if (points in name if isinstance(points, str) else name in points)
        ]
        return by_scene(outcome, method, lambda e, v: measure(e[..., chosen], v[..., chosen]))

    return values


def _percent(*args: Any, **options: Any) -> Measure:
    values = _values(*args, **options)
    return Measure(lambda outcomes, method: values(outcomes, method)[:, None], "percent")


def _error(scene: str, frames: slice = slice(None), least: int = 0) -> Measure:
    """Mean error over a range of frames, in % of the length."""
    measure = _values(scene, lambda e, v: 100 * measures.mean_error(e[:, frames]), least=least)
    return Measure(measure, digits=1)


def _kept_points(errors: np.ndarray, visible: np.ndarray) -> np.ndarray:
    return measures.points_kept(errors, NEAR)


def of_scene(scene: str) -> dict[str, Measure]:
    """The measures of every kind of scene, with headings of their table."""
    hidden = _values(scene, lambda e, v: 100 * measures.mean_error(e, ~v))
    return {
        "all frames": _error(scene),
        "while hidden": Measure(hidden, digits=1),
        "last 10 frames": _error(scene, slice(-10, None)),
        "points kept": Measure(_values(scene, _kept_points), digits=1),
        "recovered (%)": _percent(scene, found_again),
    }


_CHECKED = ("head", "left hand", "right hand")
_BEGIN, _END = published.SMILE
_PARTING, _SPOT_LOST = published.PARTING, published.SPOT_LOST
_AFTER_BLINKS = [blink + after for blink in published.BLINKS for after in _OPEN]

MEASURES: Mapping[str, Measure] = {
    **{
        f"{scene}: {name}": measure
        for scene in ("fish", "skydivers", "face")
        for name, measure in of_scene(scene).items()
    },
    "fish: kept": _percent("fish", lambda e, v: _kept_points(e, v) / e.shape[-1]),
    "fish: final error": _error("fish", slice(-10, None))._replace(kind="ratio"),
    "fish: together": _error("fish", published.FISH_TOGETHER, published.FISH_PARTED.stop),
    "fish: parted": _error("fish", published.FISH_PARTED, published.FISH_PARTED.stop),
    # The peak of each run, since the mean over runs would hide a lost run.
    "skydivers: peak": Measure(_values("skydivers", lambda e, v: e.mean(axis=2).max(axis=1))),
    "skydivers: near": _percent(
        "skydivers",
        lambda e, v: (e <= published.SKYDIVER_MOSTLY).all(axis=-1).mean(axis=-1),
        points=_CHECKED,
    ),
    **{
        f"{scene}: {words}": _error(scene, frames, after)
        for scene, after in _PARTING.items()
        for words, frames in (("before", slice(0, after)), ("after", slice(after, None)))
    },
    "skydivers: late": _error("skydivers", slice(_SPOT_LOST, None), _SPOT_LOST),
    "face: after blinks": _percent(
        "face",
        lambda e, v: (e[:, _AFTER_BLINKS] <= NEAR).mean(axis=(1, 2)),
        points="eye",
        least=published.BLINKS[-1] + _OPEN.stop,
    ),
    "face: smile": Measure(
        _values(
            "face",
            lambda e, v: (
                100 * (e[:, _BEGIN + 6 : _END - 6].mean(axis=(1, 2)) - e[:, -10:].mean(axis=(1, 2)))
            ),
            points=("right lip corner",),
            least=_END,
        )
    ),
}
