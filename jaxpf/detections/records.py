"""What ``follow`` yields: a frame, and the objects of each tracker in it."""

import dataclasses
from typing import Any, NamedTuple, Self

import numpy as np

from jaxpf.contract.errors import InputError
from jaxpf.contract.lost import judge
from jaxpf.detections.lifetimes import Changes
from jaxpf.targets.target import Start, Target


class Group(NamedTuple):
    """The Q objects of one tracker, in one frame.

    Attributes:
        since: number of the frame in which they started; of detected ones, of the first frame.
        tracker: the filter itself, without the wrapper that repeats it.
        start: of the tracker's P partitions; an empty slot has the id ``EMPTY``.
        shapes: ``[P, S]``; NaN for an empty slot.
        slots: int ``[Q]``, the partitions of the objects.
        outside: bool ``[Q]``, outside the picture.
        without_likelihood: bool ``[Q]``, no particle has any.
        lost: bool ``[Q]``, see ``jaxpf.contract.lost.judge``.
        confidence: ``[Q]``, see there; NaN for a detected object that starts in this frame, None if
            the likelihood defines none.
        summary: the filter's report, in NumPy arrays; None in a frame that is not filtered.
        state: the tracker's state, on the device; None in a frame that is not filtered.
        changes: detected objects that started, ended, or were refused.
    """

    since: int
    tracker: Any
    start: Start
    shapes: np.ndarray
    slots: np.ndarray
    outside: np.ndarray
    without_likelihood: np.ndarray
    lost: np.ndarray
    confidence: np.ndarray | None = None
    summary: Any = None
    state: Any = None
    changes: Changes | None = None

    @property
    def ids(self) -> np.ndarray:
        """Ids ``[Q]`` of the objects."""
        return self.start.ids[self.slots]

    def only(self, ids: np.ndarray) -> Self:
        """The same group, with these of its objects alone."""
        kept = np.isin(self.ids, ids)
        names = ("slots", "outside", "without_likelihood", "lost", "confidence")
        rows = {name: getattr(self, name) for name in names}
        return self._replace(**{n: each[kept] for n, each in rows.items() if each is not None})


def group_of(
    target: Target,
    frame: np.ndarray,
    since: int,
    tracker: Any,
    start: Start,
    shapes: np.ndarray,
    slots: np.ndarray,
    summary: Any = None,
    state: Any = None,
    changes: Changes | None = None,
) -> Group:
    """A group in one frame, uint8 RGB ``[H, W, 3]``; nobody is lost in a frame without summary."""
    nobody = np.zeros(len(slots), bool)
    if summary is None:
        return Group(since, tracker, start, shapes, slots, nobody, nobody, nobody, changes=changes)
    is_new = np.isin(slots, [] if changes is None else [each.slot for each in changes.started])

    def reported(name: str, of_new: Any) -> Any:
        values = getattr(summary, name, None)
        return None if values is None else np.where(is_new, of_new, np.asarray(values)[slots])

    corners = np.asarray(target.outlines(shapes, start.sizes), float)[slots]
    lowest, highest = corners.min(axis=1), corners.max(axis=1)
    outside = ~np.all((lowest < np.array(frame.shape[1::-1])) & (highest > 0), axis=1)
    without = reported("without_likelihood", False)  # new objects have their start boxes
    without = nobody if without is None else without
    confidence, lost = judge(outside, without, reported("confidence", np.nan))
    return Group(
        *(since, tracker, start, shapes, slots, outside, without, lost, confidence),
        *(summary, state, changes),
    )


class Record(NamedTuple):
    """One frame, and where its objects are.

    Attributes:
        number: of the frame, in the video.
        frame: the picture, as read.
        groups: the objects of each tracker.
    """

    number: int
    frame: np.ndarray
    groups: list[Group]

    @property
    def filtered(self) -> list[Group]:
        """The groups that were filtered in this frame."""
        return [group for group in self.groups if group.summary is not None]

    @property
    def changes(self) -> Changes | None:
        """Detected objects that started, ended, or were refused; None without detections."""
        return self.groups[0].changes

    @property
    def ids(self) -> np.ndarray:
        """Ids ``[Q]`` of all objects, group by group, as all that follows."""
        return np.concatenate([group.ids for group in self.groups])

    @property
    def shapes(self) -> np.ndarray:
        """Shapes ``[Q, S]`` of all objects."""
        return np.concatenate([group.shapes[group.slots] for group in self.groups])

    @property
    def lost(self) -> np.ndarray:
        """Whether each object is lost, bool ``[Q]``."""
        return np.concatenate([group.lost for group in self.groups])

    @property
    def start(self) -> Start:
        """Where all objects started."""
        first = self.groups[0].start
        if len(self.ids) == len(first.ids) and len(self.groups) == 1:
            return first
        rows: dict[str, Any] = {
            name: np.concatenate([getattr(group.start, name)[group.slots] for group in self.groups])
            for name in ("ids", "shapes", "sizes")
        }
        return dataclasses.replace(first, parents=(-1,) * len(self.ids), **rows)


def check_started(without_likelihood: np.ndarray, ids: np.ndarray) -> None:
    """Refuse a first frame in which an object, bool ``[P]``, has no likelihood."""
    if names := [str(ids[number]) for number in np.flatnonzero(without_likelihood)]:
        raise InputError(
            f"in the first frame every particle of target {', '.join(names)} has likelihood zero; "
            "check its box, or widen the noise of position and size."
        )
