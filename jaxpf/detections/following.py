"""Tracks objects through a video: those of the start frame, of later frames, and detected ones."""

import itertools
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

import jax
import numpy as np

from jaxpf.boxes.target import BOXES
from jaxpf.contract import calls
from jaxpf.contract.errors import InputError
from jaxpf.contract.types import TrackerLike
from jaxpf.detections.lifetimes import Rules
from jaxpf.detections.population import come_and_go
from jaxpf.detections.records import Group, Record, check_started, group_of
from jaxpf.filters import SideBySide
from jaxpf.filters.labelled.tracker import Labelled
from jaxpf.running.runs import stream
from jaxpf.targets.building import shapes_of
from jaxpf.targets.target import Start, Target


def follow(
    tracker: TrackerLike,
    key: jax.Array,
    frames: Iterable[np.ndarray],
    start: Start | None = None,
    *,
    target: Target = BOXES,
    later: Mapping[int, Start] | None = None,
    make: Callable[[np.ndarray, Start], TrackerLike] | None = None,
    detections: Mapping[int, np.ndarray | None] | Sequence[np.ndarray | None] | None = None,
    rules: Rules | None = None,
    state: Any = None,
    first: int = 0,
) -> Iterator[Record]:
    """Track objects through a video, one frame at a time; frames are not kept in memory.

    Objects that start in the same frame form a group with a tracker of its own, learned in that
    frame.  An object that starts again leaves its former group, whose other objects go on as
    before.  With ``detections`` or ``rules``, boxes come and go: all share one labelled tracker,
    whose number of slots is fixed, so that new objects need no recompilation.  Example::

        tracker = open_box_tracker(frames[0].shape, capacity=16, num_particles=1600)
        for record in follow(tracker, key, frames, detections=detections):
            print(record.number, record.ids, record.shapes)

    Args:
        tracker: of the objects in ``start``; for detected ones from ``open_box_tracker``, whose
            capacity overrides that of the rules.
        key: the run's random key.
        frames: uint8 RGB ``[H, W, 3]``, all of one size, from the start frame on.
        start: objects of the start frame, see ``Target.start``; they are where it says there.
        target: the kind of target.
        later: number of a frame -> objects that start there, or start again.
        make: function from a picture and a start to a tracker, for the groups of ``later``.
        detections: boxes ``[M, 4]`` by the frame's number, or None for a frame in which the
            detector did not run.  Without them missing detections end no object.
        rules: of starts and ends, by default ``Rules()`` with detections; given without them, the
            objects of ``start`` and ``later`` end by the rules.
        state: state of a run to resume, of the objects of ``start`` alone; the frames that it has
            tracked are passed over.
        first: number of the start frame, from which the others count on.

    Raises:
        InputError: objects are not visible where they start in the first frame, or objects start
            after the last one.
    """
    picture: Any = None

    def shown() -> Iterator[Any]:
        """The picture of the loop below, whenever a tracker asks for one."""
        while True:
            yield picture

    starts = ({first: start} if start is not None else {}) | dict(later or {})
    #: Ids that each group still tracks, None for all, and its records to come.
    groups: list[tuple[Any, Iterator[Group]]] = []
    number = begin = first if state is None else first + 1 + int(calls.time_of(state))
    if state is not None:
        assert start is not None, "a state holds the objects of the start frame"
        assert not later, "a state holds the objects of the start frame"
        groups = [(start.ids, _group(first, tracker, key, shown(), start, target, state))]
        starts = {}
    elif rules is not None or detections is not None:
        rules = rules or Rules()
        groups = [(None, come_and_go(tracker, key, shown(), starts, detections, rules, first))]
        starts = {}
    for number, picture in enumerate(itertools.islice(frames, begin - first, None), begin):
        if (new := starts.get(number)) is not None:
            own_key = key
            if groups:
                assert make is not None
                tracker, own_key = make(picture, new), jax.random.fold_in(key, number)
            groups = [(np.setdiff1d(ids, new.ids), its) for ids, its in groups]
            groups = [(ids, its) for ids, its in groups if len(ids)]
            groups.append((new.ids, _group(number, tracker, own_key, shown(), new, target)))
        parts = ((ids, next(its)) for ids, its in groups)
        yield Record(number, picture, [p if ids is None else p.only(ids) for ids, p in parts])
    if missed := [at for at in starts if at > number]:
        raise InputError(
            f"the start file has a row for frame {missed[0]}, but the last frame is {number}; "
            "remove or correct that row."
        )


def _group(
    since: int,
    tracker: TrackerLike,
    key: jax.Array,
    frames: Iterable[np.ndarray],
    start: Start,
    target: Target,
    state: Any = None,
) -> Iterator[Group]:
    """A fixed set of objects: where they start, unless they resume, and then once a frame."""
    own = tracker.tracker if isinstance(tracker, SideBySide) else tracker
    slots = np.arange(len(start.ids))
    if state is None:
        yield group_of(target, next(iter(frames)), since, own, start, start.shapes, slots)
    for tracked in stream(tracker, key, frames, state=state):
        summary = tracked.summary
        if tracked.time == 0 and isinstance(own, Labelled):
            check_started(np.asarray(summary.without_likelihood), start.ids)
        shapes = np.asarray(shapes_of(own, target, start, summary.estimate), float)
        given = since, own, start, shapes, slots, summary, tracked.state
        yield group_of(target, tracked.frame, *given)
