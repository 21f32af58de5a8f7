"""Boxes that come and go, tracked by one labelled filter with a fixed number of slots.

See ``jaxpf.filters.labelled.population`` for the filter and ``jaxpf.detections.lifetimes`` for the
rules.  The appearance of an object is learned from its box in its first frame.
"""

import dataclasses
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxpf import filters
from jaxpf.boxes.models import box_model, boxes_at
from jaxpf.boxes.target import BOXES
from jaxpf.contract import WrappedLikelihood, log_prob_all
from jaxpf.contract.errors import Argument, InputError
from jaxpf.contract.options import OPEN, complete, options_of
from jaxpf.contract.pytree import pytree_dataclass
from jaxpf.detections import lifetimes
from jaxpf.detections.lifetimes import EMPTY, Change, Changes, Living, Rules
from jaxpf.detections.records import Group, check_started, group_of
from jaxpf.filters.labelled.population import add_target, remove_target
from jaxpf.filters.labelled.tracker import Labelled
from jaxpf.likelihoods.histogram import open_histogram, with_object
from jaxpf.measures import association
from jaxpf.running import runs
from jaxpf.running.runs import init_compiled
from jaxpf.targets.building import check_names
from jaxpf.targets.target import Start

#: c of ``Detected``: beyond three standard deviations a detection hardly counts.
_OTHERS = 0.01


@pytree_dataclass
class Detected(WrappedLikelihood):
    """The likelihood of an image, multiplied by that of detections, of which some may be false.

    For a detected target the factor is::

        (exp(-r^2 / 2) + c) / (1 + c),   r^2 = sum over coordinates of ((x - place) / scale)^2

    where c accounts for a detection of another object, so that a wrong detection cannot drive a
    target's particles away.  Targets without a detection are not affected.

    Attributes:
        likelihood: of the image.
        places: ``[L, D]``, detected substates; NaN for a target without a detection.
        scale: ``[L, D]``, standard deviations of the detections.
    """

    likelihood: Any
    places: Any
    scale: Any

    def log_prob_all(self, observation, partition, substates):
        """Log-likelihoods ``[N]`` of substates ``[D, N]``."""
        of_picture = log_prob_all(self.likelihood, observation, partition, substates)
        return of_picture + self._of_detection(partition, substates)

    def _of_detection(self, partition: jax.Array, substates: jax.Array) -> jax.Array:
        place, scale = (
            jnp.asarray(values, substates.dtype)[partition].T
            for values in (self.places, self.scale)
        )
        is_detected = jnp.all(jnp.isfinite(place), axis=0)
        off = (substates - jnp.where(is_detected, place, substates)) / jnp.where(
            is_detected, scale, 1.0
        )
        word = jnp.log((jnp.exp(-0.5 * jnp.sum(off**2, axis=0)) + _OTHERS) / (1 + _OTHERS))
        return jnp.where(is_detected, word, 0.0)


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
        frame_shape: of a frame, (height, width, ...).
        capacity: C, number of slots.
        num_particles: N, shared by all tracked objects.
        typical_size: see ``open_histogram``.
        settings: options of boxes and of the labelled filter, such as ``noise_pixels`` and
            ``weights``.

    Raises:
        InputError: options that require a start frame, which a tracker without objects lacks.
    """
    labelled = filters.filter_of(settings.setdefault("method", "labelled"))
    settings["num_particles"] = num_particles
    check_names(settings, BOXES, labelled)
    values = complete(settings, labelled.build, BOXES.tracker)
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
    model = model._replace(initial=np.full((capacity, 3), np.nan, np.float32))
    return filters.build(model, **{name: values[name] for name in options_of(labelled.build)})


def come_and_go(
    tracker: Any,
    key: jax.Array,
    frames: Iterable[np.ndarray],
    named: Mapping[int, Start],
    detections: Mapping[int, np.ndarray | None] | Sequence[np.ndarray | None] | None,
    rules: Rules,
    first: int,
) -> Iterator[Group]:
    """The objects of each frame; arguments as for ``follow``, ``named`` starts by frame."""
    ids = [int(name) for start in named.values() for name in start.ids]
    if len(set(ids)) < len(ids) or min(ids, default=0) < 0:
        raise InputError(f"objects are named {ids}; give each a number of its own, from 0 on.")
    living = lifetimes.start_empty(tracker.num_partitions, max(ids, default=0))
    state: Any = init_compiled(tracker, key)
    summary: Any = None
    boxes = np.full((tracker.num_partitions, 4), np.nan)
    without = np.zeros(tracker.num_partitions, bool)
    if detections is not None and rules.detection_noise > 0:
        nothing = np.full(tracker.initial.shape, np.nan, np.float32)
        tracker = dataclasses.replace(
            tracker, likelihood=Detected(tracker.likelihood, nothing, nothing)
        )
    for number, frame in enumerate(frames, first):
        detected = None if detections is None else detections[number]
        if number > first:
            tracker = _with_detections(tracker, boxes, detected, rules)
            state, summary = runs.step(tracker, key, number - first - 1, state, frame)
            summary = jax.tree.map(np.asarray, summary)
            boxes, without = _boxes(tracker, summary.estimate), summary.without_likelihood
        if number == first + 1:
            named_first = np.isin(living.ids, named[first].ids if first in named else [])
            check_started(without & named_first, living.ids)
        asked = named.get(number)
        starting = [] if asked is None else list(zip(asked.ids.tolist(), asked.shapes, strict=True))
        living, changes = lifetimes.advance(
            living, boxes, without, detected, starting, frame.shape, rules
        )
        tracker, state, living, changes = _changed(tracker, state, living, changes, frame, ids)
        if number == first:
            _check_named(changes)
        alive = living.ids != EMPTY
        boxes, without = np.where(alive[:, None], boxes, np.nan), without & alive
        for new in changes.started:
            boxes[new.slot], without[new.slot] = new.box, False
        scales = np.ones(len(boxes))  # of an object that starts in this frame, too
        if summary is not None:
            scales = np.maximum(np.nan_to_num(summary.estimate[:, 2], nan=1.0), 1e-9)
        start = Start(living.ids, boxes, boxes[:, 2:] / scales[:, None], (-1,) * len(boxes))
        slots = np.flatnonzero(alive)
        yield group_of(BOXES, frame, first, tracker, start, boxes, slots, summary, state, changes)


def _changed(
    tracker: Labelled,
    state: Any,
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
            refused.append(Change(identity, box=new.box, reason=str(error)))
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
