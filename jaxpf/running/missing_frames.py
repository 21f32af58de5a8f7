"""Missing frames: where nothing was seen, particles move by their dynamics and nobody is weighed.

A filter need not know of it.  Its likelihood is put into a wrapper that says nothing of a missing
frame: every log-likelihood is 0, so that all weights stay, in whatever order and by whatever rule
partitions are weighed.  The inner likelihood is not asked, so that what a missing frame holds gets
neither to its ``observe`` nor into a derivative.  Where single partitions were not seen, a landmark
out of view for example, their log-likelihoods alone are 0.
"""

import dataclasses
import inspect
import itertools
from collections.abc import Callable, Iterator
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from jaxpf import contract
from jaxpf.contract.errors import InputError
from jaxpf.contract.pytree import is_concrete, pytree_dataclass
from jaxpf.running.chunks import come_one_by_one

#: Methods of a likelihood that are asked of an observation, beyond ``log_prob``.
_OF_OBSERVATIONS = frozenset(
    f"{name}{suffix}"
    for name in ("log_joint", "log_joint_labelled", "log_odds")
    for suffix in ("", "_all")
)


@pytree_dataclass
class LikelihoodWithGaps(contract.Likelihood):
    """Another likelihood, of frames that come with the word whether they were seen.

    That is ``[]``, or ``[P]`` of each partition; then a ``log_joint`` takes it as ``observed=``.

    Attributes:
        likelihood: which can do as much as this one.
    """

    likelihood: Any

    def __getattr__(self, name):
        """What is optional: absent where the inner likelihood has it not."""
        if name.startswith("__") or name == "likelihood":
            raise AttributeError(name)
        inner = getattr(self.likelihood, name)
        if name not in _OF_OBSERVATIONS:
            return inner

        def of_seen(observation, *rest):
            observation, seen = observation
            if not seen.ndim:
                return _if_seen(seen, lambda: inner(observation, *rest))
            if not name.startswith("log_odds"):
                return inner(observation, *rest, observed=seen)
            partition = rest[0]
            return jnp.where(seen[partition], inner(observation, *rest), 0)

        return of_seen

    @property
    def expecting(self):
        """The inner likelihood told what is expected, in the same wrapper."""
        inner = self.likelihood.expecting
        return lambda estimates: LikelihoodWithGaps(inner(estimates))

    @property
    def state_gradient(self):
        """That of the inner likelihood."""
        return contract.has_state_gradient(self.likelihood)

    @property
    def form(self):
        """That of the inner likelihood."""
        return getattr(self.likelihood, "form", None)

    def observe(self, frame):
        """What the inner likelihood needs of a frame, zeros of one that was not seen."""
        frame, seen = frame
        seen = jnp.asarray(seen)

        def known(x):
            # Where a compiler computes both branches, the unseen one must not meet NaN either.
            x = jnp.where(seen.any(), x, jnp.zeros_like(x))
            is_part = seen.ndim and jnp.issubdtype(x.dtype, jnp.floating)
            return jnp.where(jnp.isnan(x), 0, x) if is_part else x

        frame = jax.tree.map(known, frame)
        return _if_seen(seen.any(), lambda: self.likelihood.observe(frame)), seen

    def log_prob_all(self, observation, partition, substates):
        """The inner log-likelihoods ``[N]``, 0 of what was not seen."""
        observation, seen = observation

        def inner():
            return contract.log_prob_all(self.likelihood, observation, partition, substates)

        if seen.ndim:
            return jnp.where(contract.of_partition(seen, partition), inner(), 0)
        return _if_seen(seen, inner)


@pytree_dataclass
class LikelihoodOfNoFrame(LikelihoodWithGaps):
    """Another likelihood that sees no frame at all, so that none need be there."""

    def __getattr__(self, name):
        """As above; what is asked of an observation is 0."""
        inner = super().__getattr__(name)
        if name not in _OF_OBSERVATIONS:
            return inner

        def of_nothing(observation, *rest):
            return jnp.zeros(rest[-1].shape[-1:] if name.endswith("_all") else ())

        return of_nothing

    @property
    def expecting(self):
        """The inner likelihood told what is expected, in the same wrapper."""
        inner = self.likelihood.expecting
        return lambda estimates: LikelihoodOfNoFrame(inner(estimates))

    def observe(self, frame):
        """Nothing."""
        return ()

    def log_prob_all(self, observation, partition, substates):
        """0 for every particle, ``[N]``."""
        return jnp.zeros(substates.shape[-1:], substates.dtype)


@pytree_dataclass
class WithGaps(contract.Tracker):
    """A tracker of frames that come as ``(frame, seen)``, ``seen`` ``[]`` or ``[P]`` bool.

    Of a frame that was not seen ``log_evidence`` is exactly 0, and a confidence stays as it was.

    Attributes:
        tracker: has a ``likelihood``, or a ``tracker`` that has one, and asks it alone.
    """

    tracker: Any

    _wraps = LikelihoodWithGaps

    @property
    def num_partitions(self) -> int:
        """That of the tracker."""
        return self.tracker.num_partitions

    def init(self, key):
        """The tracker's first state."""
        return self.tracker.init(key)

    def observe(self, frame):
        """What the tracker needs of a frame, and whether it was seen."""
        inner = contract.changed_inside(self.tracker, "likelihood", self._wraps)
        return contract.observed_apart(inner)[0](frame), jnp.asarray(frame[1])

    def step_observed(self, key, state, observation):
        """The tracker's next state and summary."""
        observation, seen = observation
        step = contract.observed_apart(
            contract.changed_inside(self.tracker, "likelihood", self._wraps)
        )[1]
        after, summary = step(key, state, observation)

        def replaced(target, name, value, seen):
            now = getattr(target, name, None)
            if now is None or value is None:
                return target
            kept = jnp.where(seen, now, jnp.asarray(value).astype(now.dtype))
            return dataclasses.replace(target, **{name: kept})

        before = getattr(state, "log_odds", None)
        after = replaced(after, "log_odds", before, seen)
        if before is not None:
            summary = replaced(summary, "confidence", jax.nn.sigmoid(before), seen)
        summary = replaced(summary, "label_log_evidence", 0.0, seen.any())
        return after, replaced(summary, "log_evidence", 0.0, seen.any())


@pytree_dataclass
class WithoutFrames(WithGaps):
    """A tracker of frames ``(anything, False)``."""

    _wraps = LikelihoodOfNoFrame


def marked(tracker: Any, frames: Any, observed: Any = None) -> tuple[Any, Any]:
    """A tracker and frames of which some are missing; as they were if none is.

    Args:
        tracker: any tracker.
        frames: ``[T, ...]``, or frames one by one.
        observed: ``[T]`` bool, which frames were seen, or ``[T, P]``, which partitions; None: all
            but those frames of floats that are NaN throughout.  Frames that are traced are looked
            at as they come.

    Raises:
        InputError: ``observed`` has another shape, or the tracker cannot leave out what is missing.
    """
    if isinstance(tracker, WithGaps):
        return tracker, frames
    if observed is None:
        seen = None if come_one_by_one(frames) else _seen(frames)
        if seen is None or not _can_have_gaps(tracker):
            return tracker, frames
        return WithGaps(tracker), (frames, seen)
    check_gaps(tracker)
    if come_one_by_one(frames):
        return WithGaps(tracker), _pairs(frames, observed)
    total, parts = len(jax.tree.leaves(frames)[0]), getattr(tracker, "num_partitions", None)
    shape = np.shape(observed)
    if shape != (total,) and shape != (total, parts):
        of_parts = "" if parts is None else f", or which partitions, [{total}, {parts}]"
        raise InputError(
            f"observed has shape {shape}; say of each of the {total} frames whether it was seen, "
            f"[{total}]{of_parts}."
        )
    if len(shape) == 2:
        _check_parts(tracker)
    return WithGaps(tracker), (frames, _as_bool(observed))


def unmarked(tracker: Any, frames: Any) -> tuple[Any, Any]:
    """A tracker and its frames, as they were before ``marked``."""
    if not isinstance(tracker, WithGaps):
        return tracker, frames
    return tracker.tracker, frames if come_one_by_one(frames) else frames[0]


def marked_one_by_one(tracker: Any, frames: Any, observed: Any = None) -> Iterator[Any]:
    """For each single frame: the frame, the tracker for it, and the frame as that one takes it."""
    if observed is not None:
        check_gaps(tracker)
        for frame, seen in _pairs(frames, observed):
            yield frame, WithGaps(tracker), (frame, seen)
        return
    for frame in frames:
        its = marked(tracker, jax.tree.map(lambda x: np.asarray(x)[None], frame))[0]
        if its is tracker:
            yield frame, tracker, frame
        else:
            yield frame, its, (frame, False)


def _pairs(frames: Any, observed: Any) -> Iterator[Any]:
    for frame, seen in itertools.zip_longest(frames, observed):
        if frame is None or seen is None:
            raise InputError("observed and frames differ in length; say of each frame if it is.")
        yield frame, _as_bool(seen)


def _as_bool(observed: Any) -> Any:
    return observed.astype(bool) if isinstance(observed, jax.Array) else np.asarray(observed, bool)


def _seen(frames: Any) -> Any:
    """``[T]`` bool, which frames are not NaN throughout; None where all are seen."""
    leaves = jax.tree.leaves(frames)
    if not leaves or not all(jnp.issubdtype(jnp.result_type(x), jnp.floating) for x in leaves):
        return None
    if not is_concrete(frames):
        return ~_nan_throughout(jnp, leaves)
    # A frame that is NaN throughout begins with it: the others need not be read.
    first = [np.isnan(np.asarray(x[(slice(None), *[0] * (np.ndim(x) - 1))])) for x in leaves]
    places = np.flatnonzero(np.all(first, axis=0))
    missing = np.zeros(len(leaves[0]), bool)
    if len(places):
        missing[places] = _nan_throughout(np, [np.asarray(x[places]) for x in leaves])
    return ~missing if missing.any() else None


def _nan_throughout(library: Any, leaves: list[Any]) -> Any:
    of_leaves = [library.isnan(x).reshape(len(x), -1).all(axis=1) for x in leaves]
    return library.all(library.stack(of_leaves), axis=0)


def _if_seen(seen: jax.Array, compute: Callable[[], Any]) -> Any:
    """What is computed, or zeros in its place."""

    def zeros() -> Any:
        return jax.tree.map(lambda x: jnp.zeros(x.shape, x.dtype), jax.eval_shape(compute))

    return lax.cond(seen, compute, zeros)


def _can_have_gaps(tracker: Any) -> bool:
    return hasattr(tracker, "likelihood") or (
        hasattr(tracker, "tracker") and _can_have_gaps(tracker.tracker)
    )


def check_gaps(tracker: Any) -> None:
    """Refuse a tracker that cannot do without a frame.

    Raises:
        InputError: it has no likelihood to leave out.
    """
    if not _can_have_gaps(tracker):
        raise InputError(
            f"{type(tracker).__name__} has no field likelihood that could be left out where a "
            "frame is missing; give it one, or frames that were all seen."
        )


def _check_parts(tracker: Any) -> None:
    """Refuse a tracker of which single partitions cannot be missing.

    Raises:
        InputError: its particles carry one target each; its joint likelihood does not say how.
    """
    while not hasattr(tracker, "likelihood"):
        tracker = tracker.tracker
    if hasattr(tracker, "population"):
        raise InputError(
            f"{type(tracker).__name__} compares particles of different targets, which a missing "
            "target would upset; give observed for whole frames, [T]."
        )
    likelihood = tracker.likelihood
    for name in _OF_OBSERVATIONS:
        joint = getattr(likelihood, name, None)
        takes = joint is None or "observed" in inspect.signature(joint).parameters
        if name.startswith("log_joint") and not takes:
            raise InputError(
                f"{type(likelihood).__name__}.{name} does not say what a missing partition means; "
                "give it an argument observed [P], or observed for whole frames, [T]."
            )
