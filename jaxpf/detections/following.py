"""Tracks a varying number of boxes with a labelled filter; starts and ends between frames.

The number of slots is fixed, so that new objects need no recompilation.  See
``jaxpf.filters.labelled.population`` for the filter and ``jaxpf.detections.lifetimes`` for the
rules.  The appearance of an object is learned from its box in its first frame.  Example::

    tracker = open_box_tracker(frames[0].shape, capacity=16, num_particles=1600)
    for tracked in follow(tracker, jax.random.key(0), frames, detections):
        print(tracked.ids, tracked.boxes)
"""

import dataclasses
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxpf import filters, running
from jaxpf.boxes.models import box_model, boxes_at
from jaxpf.boxes.target import BOXES
from jaxpf.contract.errors import Argument, InputError, check_type
from jaxpf.contract.model import Model
from jaxpf.contract.numbers import check_array, numbers_in
from jaxpf.contract.options import OPEN, complete
from jaxpf.contract.state import Summary
from jaxpf.detections import lifetimes
from jaxpf.detections.lifetimes import EMPTY, Changes, Living, Refusal, Rules
from jaxpf.filters.labelled.population import add_target, remove_target
from jaxpf.filters.labelled.refusals import check_started
from jaxpf.filters.labelled.tracker import Labelled
from jaxpf.likelihoods.color import check_frame
from jaxpf.likelihoods.detected import Detected
from jaxpf.likelihoods.open_histogram import open_histogram, with_object
from jaxpf.measures import association
from jaxpf.running import streaming
from jaxpf.running.runs import init_compiled
from jaxpf.targets.building import check_names

if TYPE_CHECKING:
    from jaxpf.filters.labelled.state import LabelledState


class TrackedObjects(NamedTuple):
    """The objects in a frame, in C slots, including the starts and ends of that frame.

    Attributes:
        time: number of the frame, from 0.
        frame: the picture, as read.
        ids: int ``[C]``, ``EMPTY`` (-1) for an empty slot.
        boxes: ``[C, 4]``, x, y, w, h in pixels; NaN for an empty slot.  An object that starts in
            this frame has its start box.
        without_likelihood: ``[C]`` bool, no particle had any likelihood.
        changes: objects that started, ended, or were refused for lack of a slot.
        summary: the filter's report; None for the first frame, which is not filtered.
        state: the tracker's state, on the device.
    """

    time: int
    frame: np.ndarray
    ids: np.ndarray
    boxes: np.ndarray
    without_likelihood: np.ndarray
    changes: Changes
    summary: Summary
    state: "LabelledState"


def open_model(
    values: Mapping[str, Any],
    frame_shape: Sequence[int],
    capacity: int,
    typical_size: tuple[float, float],
    num_particles: int | None = None,
) -> Model:
    """Build a model with empty slots for boxes that move by pixels and are known by colour.

    Args:
        values: of the options of ``jaxpf.boxes.tracker``, all.
        frame_shape: of a frame, (height, width, ...).
        capacity: C, number of slots.
        typical_size: see ``open_histogram``.
        num_particles: chooses the method of the histograms if ``values`` leave it open.

    Raises:
        InputError: options that require a start frame, which a tracker without objects lacks.
    """
    if values["appearance"] not in (OPEN, "colour") or values["motion"] == "relative":
        raise InputError(
            "objects that come and go are known by colour and move by pixels, because there is "
            "no start frame to learn from; leave out ",
            Argument("appearance"),
            " and ",
            Argument("motion"),
            ".",
        )
    values = BOXES.settle({**values, "appearance": "colour"}, {})
    check_array("frame_shape", frame_shape, "height and width of a frame, [>= 2]", least=1)
    height, width = frame_shape[:2]
    histograms = open_histogram(
        capacity,
        (height, width),
        typical_size=typical_size,
        sharpness=values["sharpness"],
        bands=values["bands"],
        method=values["likelihood"],
        num_particles=num_particles,
    )
    model = box_model(histograms, np.full((capacity, 4), np.nan), values["noise_pixels"])
    return model._replace(initial=np.full((capacity, 3), np.nan, np.float32))


def open_box_tracker(
    frame_shape: Sequence[int],
    *,
    capacity: int = 16,
    num_particles: int = 1600,
    typical_size: tuple[float, float] = (32.0, 64.0),
    **settings: Any,
) -> Labelled:
    """Build a labelled tracker with ``capacity`` empty slots; ``follow`` fills them.

    Args:
        frame_shape, capacity, typical_size: as in ``open_model``.
        num_particles: N, shared by all tracked objects.
        settings: options of boxes and of the labelled filter, such as ``noise_pixels`` and
            ``weights``.
    """
    settings["num_particles"] = num_particles
    check_names(settings, BOXES, filters.filter_of("labelled"))
    values = complete(BOXES.tracker, settings)
    model = open_model(values, frame_shape, capacity, typical_size, num_particles)
    of_filter = complete(filters.filter_of("labelled").options, settings)
    return filters.build(model, **of_filter)


def follow(
    tracker: Labelled,
    key: jax.Array,
    frames: Iterable[np.ndarray],
    detections: Sequence[np.ndarray | None] | None = None,
    *,
    named: Sequence[tuple[int, int, np.ndarray]] = (),
    rules: Rules | None = None,
) -> Iterator[TrackedObjects]:
    """Track detected and named objects, one frame at a time; frames are not kept in memory.

    Args:
        tracker: from ``open_box_tracker``; its capacity overrides that of the rules.
        key: the run's random key.
        frames: uint8 RGB ``[H, W, 3]``, all of one size.
        detections: boxes ``[M, 4]`` of every frame, or None for a frame in which the detector did
            not run.  Without detections only named objects start, and missing detections end none.
        named: time, id and box of objects that start at that time; ids from 0, each once.
        rules: of starts and ends; by default ``Rules()``.

    Raises:
        InputError: in the first frame, more objects are named than there are slots or a named
            object is not visible; in the second, a named object has no likelihood; there are more
            frames than detections; or an id is given twice.
    """
    rules = Rules() if rules is None else rules
    check_type("tracker", tracker, Labelled)
    check_type("rules", rules, Rules)
    if detections is not None and not hasattr(detections, "__getitem__"):
        raise InputError(
            f"detections is {type(detections).__name__}; give a list of the boxes of every frame."
        )
    key = running.as_key(key)
    starts: dict[int, list[tuple[int, np.ndarray]]] = {}
    for entry in named:
        is_three = isinstance(entry, tuple | list) and len(entry) == 3
        if not is_three or not all(isinstance(x, int | np.integer) for x in entry[:2]):
            raise InputError(f"named holds {entry!r:.60}; give (time, id, box), time and id whole.")
        time, identity, given = entry
        box = numbers_in(f"the box of object {identity}", given, "x, y, width and height, [4]")
        starts.setdefault(time, []).append((identity, box))
    ids = [identity for _, identity, _ in named]
    if len(set(ids)) < len(ids) or min(ids, default=0) < 0:
        raise InputError(f"objects are named {ids}; give each a number of its own, from 0 on.")
    living = lifetimes.start_empty(tracker.num_targets, max(ids, default=0))
    state = init_compiled(tracker, key)
    summary: Any = None
    boxes = np.full((tracker.num_targets, 4), np.nan)
    without = np.zeros(tracker.num_targets, bool)
    if detections is not None and rules.detection_noise > 0:
        nothing = np.full(tracker.initial.shape, np.nan, np.float32)
        tracker = dataclasses.replace(
            tracker, likelihood=Detected(tracker.likelihood, nothing, nothing)
        )
    for time, frame in enumerate(frames):
        check_frame(frame)
        detected = _of_frame(detections, time)
        if time > 0:
            tracker = _with_detections(tracker, boxes, detected, rules)
            state, summary = streaming.step(tracker, key, time - 1, state, frame)
            summary = jax.tree.map(np.asarray, summary)
            boxes, without = _boxes(tracker, summary.estimate), summary.without_likelihood
        if time == 1:
            named_first = np.isin(living.ids, [identity for identity, _ in starts.get(0, [])])
            first = dataclasses.replace(summary, without_likelihood=without & named_first)
            check_started(first, living.ids)
        living, changes = lifetimes.advance(
            living, boxes, without, detected, starts.get(time, []), frame.shape, rules
        )
        tracker, state, living, changes = _changed(tracker, state, living, changes, frame, ids)
        if time == 0:
            _check_named(changes)
        alive = living.ids != EMPTY
        boxes, without = np.where(alive[:, None], boxes, np.nan), without & alive
        for new in changes.started:
            boxes[new.slot], without[new.slot] = new.box, False
        yield TrackedObjects(time, frame, living.ids, boxes, without, changes, summary, state)


def _of_frame(detections: Sequence[np.ndarray | None] | None, time: int) -> np.ndarray | None:
    if detections is None:
        return None
    try:
        given = detections[time]
    except IndexError:
        raise InputError(
            f"detections end with frame {time - 1}, and there is a frame {time}; give boxes [M, 4] "
            "for every frame, none as an array of shape [0, 4]."
        ) from None
    if given is None:
        return None
    if hasattr(given, "__len__") and len(given) == 0:
        return np.zeros((0, 4))
    wanted = "boxes x, y, width and height, [..., 4]"
    boxes = np.atleast_2d(numbers_in(f"detections[{time}]", given, wanted))
    check_array(f"detections[{time}]", boxes, "boxes x, y, width and height, [M, 4]")
    return boxes


def _changed(
    tracker: Labelled,
    state: "LabelledState",
    living: Living,
    changes: Changes,
    frame: np.ndarray,
    named: Sequence[int],
) -> tuple[Labelled, Any, Living, Changes]:
    """Apply starts and ends to tracker and state; return them and the objects that did start.

    A detected object that cannot start (not in ``named``) may start later, at a better detection.
    """
    ids, started, refused = living.ids.copy(), [], list(changes.refused)
    for gone in changes.ended:
        state = remove_target(state, jnp.int32(gone.slot))
    for new in changes.started:
        slot = jnp.int32(new.slot)
        try:
            likelihood: Any = with_object(_of_pictures(tracker), slot, frame, new.box)
        except InputError as error:  # too small, or too far outside the frame
            ids[new.slot] = EMPTY
            identity = new.id if new.id in named else EMPTY
            refused.append(Refusal(identity, new.box, str(error)))
            continue
        if isinstance(tracker.likelihood, Detected):
            likelihood = dataclasses.replace(tracker.likelihood, likelihood=likelihood)
        tracker = dataclasses.replace(tracker, likelihood=likelihood)
        centre = new.box[:2] + new.box[2:] / 2
        state = add_target(state, slot, jnp.asarray([*centre, 1.0]))
        started.append(new)
    return tracker, state, living._replace(ids=ids), Changes(started, changes.ended, refused)


def _with_detections(
    tracker: Labelled, boxes: np.ndarray, detections: np.ndarray | None, rules: Rules
) -> Labelled:
    """Pass to the tracker the detections that match its objects' boxes in the previous frame."""
    if not isinstance(tracker.likelihood, Detected):
        return tracker
    if detections is None:
        detections = np.zeros((0, 4))
    mine = association.assigned(boxes, detections, rules.detection_iou)
    own = np.append(detections, np.full((1, 4), np.nan), axis=0)[mine]  # -1 is the last
    sizes = np.asarray(_of_pictures(tracker).sizes)
    size = np.sqrt(np.prod(own[:, 2:] / sizes, axis=1, keepdims=True))
    places = np.hstack([own[:, :2] + own[:, 2:] / 2, size])
    scale = rules.detection_noise * np.hstack([own[:, 2:], size])
    likelihood = dataclasses.replace(
        tracker.likelihood, places=places.astype(np.float32), scale=scale.astype(np.float32)
    )
    return dataclasses.replace(tracker, likelihood=likelihood)


def _of_pictures(tracker: Labelled) -> Any:
    """The likelihood of the picture, without the detection term."""
    likelihood = tracker.likelihood
    return likelihood.likelihood if isinstance(likelihood, Detected) else likelihood


def _boxes(tracker: Labelled, estimate: np.ndarray) -> np.ndarray:
    """Boxes ``[C, 4]`` of estimates (u, v, a), which are relative to the start boxes."""
    return boxes_at(estimate, _of_pictures(tracker).sizes).astype(float)


def _check_named(changes: Changes) -> None:
    """Refuse to begin if a named object cannot start; detected ones may start later."""
    for refusal in changes.refused:
        if refusal.id != EMPTY:
            x, y, w, h = refusal.box
            raise InputError(
                f"object {refusal.id} at {x:g},{y:g},{w:g},{h:g} cannot start in the first frame: "
                f"{refusal.reason}"
            )
