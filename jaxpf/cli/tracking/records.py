"""Per-frame records, shared by a fixed set of objects and by objects that come and go."""

import dataclasses
import itertools
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from jaxpf import contract
from jaxpf.cli.tracking.detector import Detector, by_frame
from jaxpf.cli.tracking.track_table import places_of
from jaxpf.contract.lost import judge
from jaxpf.detections import follow
from jaxpf.detections.lifetimes import EMPTY, Changes
from jaxpf.evaluation.trackers import shapes_of
from jaxpf.media.overlay import NUM_COLOURS, object_colours
from jaxpf.running.streaming import stream
from jaxpf.targets.target import Start, Target

if TYPE_CHECKING:
    import jax
    from jax.typing import ArrayLike

    from jaxpf.contract.types import TrackerLike
    from jaxpf.filters.labelled.tracker import Labelled

#: All partitions.
_ALL = slice(None)


class Record(NamedTuple):
    """One frame, ready for the writers.

    Attributes:
        number: frame number in the video, from 0.
        frame: uint8 RGB ``[H, W, 3]``.
        start: the P objects in this frame, with their ids.
        colours: uint8 RGB ``[P, 3]``.
        shapes: ``[P, S]``.
        places: columns of tracks.csv, see ``places_of``; values alone in the start frame.
        lost: bool ``[P]``, see ``jaxpf.contract.lost.judge``.
        confidence: ``[P]``, see there; None if the likelihood defines none.
        outside: bool ``[P]``, outside the image; None in a frame that is not filtered.
        without_likelihood: bool ``[P]``, no particle has any; None likewise.
        errors: columns x_mc_error and y_mc_error, Monte Carlo standard errors, if requested.
        summary: summary of all partitions; None in a frame that is not filtered.
        state: holds the particles; None in a frame that is not filtered.
        slots: partitions occupied by the objects.
        changes: starts and ends; None for a fixed set of objects.
        scene: the scene of the tracker that this record comes from, if not the run's.
        parts: records of groups of objects with trackers of their own; () for one tracker.  This
            record then joins their ``start``, ``colours``, ``shapes`` and ``lost`` alone.
    """

    number: int
    frame: np.ndarray
    start: Start
    colours: np.ndarray
    shapes: np.ndarray
    places: dict[str, np.ndarray]
    lost: np.ndarray
    confidence: np.ndarray | None = None
    outside: np.ndarray | None = None
    without_likelihood: np.ndarray | None = None
    errors: Mapping[str, np.ndarray] = {}
    summary: Any = None
    state: Any = None
    slots: Any = _ALL
    changes: Changes | None = None
    scene: "Scene | None" = None
    parts: tuple["Record", ...] = ()

    @property
    def groups(self) -> tuple["Record", ...]:
        """The record of each tracker."""
        return self.parts or (self,)

    @property
    def filtered(self) -> list["Record"]:
        """The groups that were filtered in this frame."""
        return [group for group in self.groups if group.summary is not None]


@dataclasses.dataclass(frozen=True)
class Scene:
    """Settings shared by all frames of a run.

    Attributes:
        target: the kind of target.
        tracker: the filter itself, without the wrapper that repeats it.
        start: where objects start.
        size: width and height of the frames, pixels.
        shown_at: function from a frame's number to the seconds at which it is shown.
        first: number of the start frame.
        check_first: refuses objects that are not visible in the first frame.
    """

    target: Target
    tracker: Any
    start: Start
    size: tuple[int, int]
    shown_at: Callable[[int], float]
    first: int
    check_first: Callable[[Any, Any], None]

    @property
    def has_own_boxes(self) -> bool:
        """Whether a user-defined tracker converts estimates to boxes itself."""
        return self.target.has_boxes and hasattr(self.tracker, "boxes")

    def model_error(self, num_partitions: int) -> np.ndarray:
        """``[P, 3]``, see ``jaxpf.contract.Likelihood``."""
        return contract.model_error(self.tracker, num_partitions)

    def outside(self, start: Start, shapes: np.ndarray) -> np.ndarray:
        """Which shapes lie outside the image or are not finite."""
        corners = np.asarray(self.target.outlines(start, shapes), float)
        lowest, highest = corners.min(axis=1), corners.max(axis=1)
        return ~np.all((lowest < np.array(self.size)) & (highest > 0), axis=1)

    def shapes(self, start: Start, estimate: "ArrayLike") -> np.ndarray:
        """Shapes ``[..., P, S]`` of estimates or particles ``[..., P, D]``."""
        return np.asarray(shapes_of(self.tracker, self.target, start, estimate), float)


def fixed_population(
    scene: Scene,
    tracker: "TrackerLike",
    key: "jax.Array",
    frame: np.ndarray,
    frames: Iterable[np.ndarray],
    before: tuple[Any, int],
) -> Iterator[Record]:
    """Records of objects that exist from the start.

    Args:
        scene: settings shared by all frames.
        tracker: the tracker to run.
        key: random key.
        frame: the start frame; its record holds the user's start positions.
        frames: frames after the start frame, or after those of a resumed run.
        before: state of a resumed run and its number of frames; else None and 0.
    """
    start, (state, time) = scene.start, before
    colours, nobody = object_colours(len(start.ids)), np.zeros(len(start.ids), bool)

    cloud = state if time and not scene.has_own_boxes else None
    places, centres = places_of(scene, scene.first, start, start.shapes, cloud)
    if not time:
        places = {name: places[name] for name in scene.target.columns}
        yield Record(scene.first, frame, start, colours, start.shapes, places, nobody)
    elif not hasattr(cloud, "substates"):
        centres = np.full_like(centres, np.nan)
    for tracked in stream(tracker, key, frames, state=state):
        summary = tracked.summary
        if tracked.time == 0:
            scene.check_first(summary, start.ids)
        shapes = scene.shapes(start, summary.estimate)
        outside = scene.outside(start, shapes)
        hopeless = getattr(summary, "without_likelihood", None)
        hopeless = nobody if hopeless is None else hopeless
        confidence, lost = judge(outside, hopeless, getattr(summary, "confidence", None))
        cloud = None if scene.has_own_boxes else tracked.state
        number = scene.first + 1 + tracked.time
        places, centres = places_of(scene, number, start, shapes, cloud, centres)
        variance, errors = getattr(summary, "estimate_variance", None), {}
        if variance is not None and scene.target.has_places:
            errors = dict(
                zip(("x_mc_error", "y_mc_error"), np.sqrt(variance)[:, :2].T, strict=True)
            )
        yield Record(
            number=number,
            frame=tracked.frame,
            start=start,
            colours=colours,
            shapes=shapes,
            places=places,
            lost=lost,
            confidence=confidence,
            outside=outside,
            without_likelihood=hopeless,
            errors=errors,
            summary=summary,
            state=tracked.state,
        )


def changing_population(
    scene: Scene,
    tracker: "Labelled",
    key: "jax.Array",
    frame: np.ndarray,
    frames: Iterable[np.ndarray],
    detector: Detector,
) -> Iterator[Record]:
    """Records of objects that come and go; an object has rows only while it exists.

    Args:
        scene, tracker, key, frame, frames: see ``fixed_population``.
        detector: detections and the rules of starts and ends.
    """
    detections, named = by_frame(detector, scene.start, scene.first)
    frames = itertools.chain([frame], frames)
    rules, centres, ids = detector.rules, None, np.zeros(0, int)
    palette = object_colours(NUM_COLOURS)
    for tracked in follow(tracker, key, frames, detections, named=named, rules=rules):
        slots = np.flatnonzero(tracked.ids != EMPTY)
        # Sizes at which a scale of 1 gives these boxes.
        scales = np.ones(len(tracked.ids))
        if tracked.summary is not None:
            # An object that starts in this frame has no estimate yet, and a scale of 1.
            scales = np.maximum(np.nan_to_num(tracked.summary.estimate[:, 2], nan=1.0), 1e-9)
        all_ = dataclasses.replace(
            scene.start, ids=tracked.ids, sizes=tracked.boxes[:, 2:] / scales[:, None]
        )
        start = dataclasses.replace(all_, ids=tracked.ids[slots], sizes=all_.sizes[slots])
        if centres is not None:
            centres = np.where((tracked.ids == ids)[:, None], centres, np.nan)
        state = None if tracked.summary is None else tracked.state
        number = scene.first + tracked.time
        places, centres = places_of(scene, number, all_, tracked.boxes, state, centres, slots)
        if tracked.summary is None:
            places = {name: places[name] for name in scene.target.columns}
        ids = tracked.ids
        shapes = tracked.boxes[slots]
        outside = scene.outside(start, shapes) if len(slots) else np.zeros(0, bool)
        confidence = getattr(tracked.summary, "confidence", None)
        if confidence is not None:
            confidence = np.array(confidence)
            confidence[[new.slot for new in tracked.changes.started]] = np.nan  # not yet known
            confidence = confidence[slots]
        confidence, lost = judge(outside, tracked.without_likelihood[slots], confidence)
        yield Record(
            number=number,
            frame=tracked.frame,
            start=start,
            colours=palette[start.ids % NUM_COLOURS],
            shapes=shapes,
            places=places,
            lost=lost,
            confidence=confidence,
            outside=outside,
            without_likelihood=tracked.without_likelihood[slots],
            summary=tracked.summary,
            state=tracked.state,
            slots=slots,
            changes=tracked.changes,
        )
