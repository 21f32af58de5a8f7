"""Missing frames: particles move by their dynamics and are not weighted.

Filters need no code for missing frames.  A wrapper around the likelihood returns log-likelihood 0
in a missing frame, so weights do not change, with any ordering and weighting rule.  The wrapper
does not call the inner likelihood, so a missing frame's values do not reach its ``observe`` or any
derivative.  If single partitions are missing, such as a landmark out of view, only their
log-likelihoods are 0.

The evidence of a missing frame is the filter's total weight.  It is 1 for most filters.  It is
random with mean 1 if selections do not preserve it (``Soft`` gradients, ``Labelled`` with corrected
weights), and has a derivative if the weights have one (``StopGradient``,
``motion_gradient="score"``).  Dropping these terms would bias the evidence and its gradient.
"""

import dataclasses
import inspect
import itertools
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from jaxpf import contract
from jaxpf.contract.errors import InputError, check_type
from jaxpf.contract.numbers import check_array
from jaxpf.contract.pytree import is_concrete, pytree_dataclass
from jaxpf.running.chunks import come_one_by_one

#: Tolerated rounding of a sum of weights, in units in the last place: enough for several stages of
#: a million particles.
_ROUNDING = 1000
#: Methods of a likelihood that take an observation, beyond ``log_prob``.
_OF_OBSERVATIONS = frozenset(
    f"{name}{suffix}"
    for name in ("log_joint", "log_joint_labelled", "log_odds")
    for suffix in ("", "_all")
)


@pytree_dataclass
class LikelihoodWithGaps(contract.Likelihood):
    """A likelihood of frames ``(frame, seen)``; ``seen`` is bool ``[]``, or ``[P]`` by partition.

    With ``[P]``, the inner ``log_joint`` gets ``observed=seen``.

    Attributes:
        likelihood: the inner likelihood.
    """

    likelihood: Any

    def __getattr__(self, name):
        """Optional methods, only if the inner likelihood defines them."""
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
        """Forwards to the inner likelihood and wraps the result."""
        inner = self.likelihood.expecting
        return lambda estimates: type(self)(inner(estimates))

    @property
    def look_near(self):
        """Looks only at frames that were seen, see ``jaxpf.contract.looked_near``."""
        inner = self.likelihood.look_near

        def of_seen(observation, estimates):
            observation, seen = observation
            return _if_seen(seen.any(), lambda: inner(observation, estimates)), seen

        return of_seen

    @property
    def at_frame(self):
        """Forwards to the inner likelihood and wraps the result."""
        inner = self.likelihood.at_frame
        return lambda time: type(self)(inner(time))

    @property
    def state_gradient(self):
        """Forwards to the inner likelihood."""
        return contract.has_state_gradient(self.likelihood)

    @property
    def form(self):
        """Forwards to the inner likelihood."""
        return getattr(self.likelihood, "form", None)

    def as_seen(self, observation):
        """See ``jaxpf.contract.as_seen``."""
        return self.likelihood, *observation

    def observe(self, frame):
        """The inner observation of a frame, zeros if it was not seen."""
        frame, seen = frame
        seen = jnp.asarray(seen)
        can_be_nan = getattr(self.likelihood, "handles_nan", False)

        def without_nan(x):
            # The compiler may compute both branches, so the unused one must not see NaN.
            x = jnp.where(seen.any(), x, jnp.zeros_like(x))
            is_part = seen.ndim and not can_be_nan and jnp.issubdtype(x.dtype, jnp.floating)
            return jnp.where(jnp.isnan(x), 0, x) if is_part else x

        frame = jax.tree.map(without_nan, frame)
        return _if_seen(seen.any(), lambda: self.likelihood.observe(frame)), seen

    def log_prob_all(self, observation, partition, substates):
        """The inner log-likelihoods ``[N]``, 0 for frames or partitions that were not seen."""
        observation, seen = observation

        def inner():
            return contract.log_prob_all(self.likelihood, observation, partition, substates)

        if seen.ndim:
            return jnp.where(contract.of_partition(seen, partition), inner(), 0)
        return _if_seen(seen, inner)


@pytree_dataclass
class LikelihoodOfNoFrame(LikelihoodWithGaps):
    """A likelihood for runs in which all frames are missing."""

    def __getattr__(self, name):
        """Optional methods of the inner likelihood; functions of an observation return 0."""
        inner = super().__getattr__(name)
        if name not in _OF_OBSERVATIONS:
            return inner

        def of_nothing(observation, *rest):
            return jnp.zeros(rest[-1].shape[-1:] if name.endswith("_all") else ())

        return of_nothing

    @property
    def look_near(self):
        """Looks at nothing; only if the inner likelihood looks near estimates."""
        _ = self.likelihood.look_near
        return lambda observation, estimates: observation

    def as_seen(self, observation):
        """See ``jaxpf.contract.as_seen``: nothing was seen."""
        return self.likelihood, None, np.False_

    def observe(self, frame):
        """Ignore the frame."""
        return ()

    def log_prob_all(self, observation, partition, substates):
        """0 for every particle, ``[N]``."""
        return jnp.zeros(substates.shape[-1:], substates.dtype)


@pytree_dataclass
class WithGaps(contract.Tracker):
    """A tracker of frames ``(frame, seen)``; ``seen`` is bool ``[]`` or ``[P]``.

    In a missing frame, ``log_evidence`` is the filter's log total weight, exactly 0 if it is 0 by
    construction, and confidence does not change.

    Attributes:
        tracker: has a ``likelihood``, or a ``tracker`` that has one.
    """

    tracker: Any

    _wraps = LikelihoodWithGaps

    @property
    def num_partitions(self) -> int:
        """Number of partitions of the tracker, P."""
        return self.tracker.num_partitions

    def init(self, key):
        """Return the tracker's initial state."""
        return self.tracker.init(key)

    def observe(self, frame):
        """Return the tracker's observation of a frame, and whether it was seen."""
        inner = contract.changed_inside(self.tracker, "likelihood", self._wraps)
        return contract.observed_apart(inner)[0](frame), jnp.asarray(frame[1])

    def step_observed(self, key, state, observation):
        """Return the tracker's next state and summary."""
        observation, seen = observation
        step = contract.observed_apart(
            contract.changed_inside(self.tracker, "likelihood", self._wraps)
        )[1]
        state, summary = step(key, state, observation)
        totals = {
            name: _without_rounding(getattr(summary, name), seen.any())
            for name in ("log_evidence", "label_log_evidence")
            if getattr(summary, name, None) is not None
        }
        return state, dataclasses.replace(summary, **totals) if totals else summary


@pytree_dataclass
class WithoutFrames(WithGaps):
    """A tracker of missing frames ``(anything, False)``."""

    _wraps = LikelihoodOfNoFrame


def _without_rounding(log_total: jax.Array, seen: jax.Array) -> jax.Array:
    """Round log total weights of missing frames to 0 if they are 0 up to rounding.

    Keeps the derivative, which may be random even if the value is not.
    """
    is_one = ~seen & (jnp.abs(log_total) < _ROUNDING * jnp.finfo(log_total.dtype).eps)
    zero = jnp.where(is_one, log_total, 0.0)
    return jnp.where(is_one, zero - lax.stop_gradient(zero), log_total)


def marked(tracker: Any, frames: Any, observed: Any = None, first: int = 0) -> tuple[Any, Any]:
    """Mark missing frames; return tracker and frames unchanged if none is missing.

    Args:
        tracker: any tracker.
        frames: ``[T, ...]``, or an iterable of single frames.
        observed: ``[T]`` bool, which frames were seen, or ``[T, P]``, which partitions.  None: all
            frames except float frames that are entirely NaN; traced frames are tested at run time.
            In the shape of ``frames``: which components, for a likelihood that handles NaN.
        first: number of the first frame, for messages.

    Raises:
        InputError: ``observed`` has a wrong shape, the tracker does not support missing frames, or
            a frame that was seen holds NaN.
    """
    if isinstance(tracker, WithGaps):
        return tracker, frames
    if observed is None:
        if come_one_by_one(frames) or not _can_have_gaps(tracker):
            return tracker, frames
        seen = _seen(frames)
        _check_nan(tracker, frames, seen, first)
        if seen is None:
            return tracker, frames
        return WithGaps(tracker), (frames, seen)
    check_gaps(tracker)
    if come_one_by_one(frames):
        return WithGaps(tracker), _pairs(tracker, frames, observed)
    total, parts = len(jax.tree.leaves(frames)[0]), getattr(tracker, "num_partitions", None)
    check_array("observed", observed, "one bool for every frame")
    shape = np.shape(observed)
    if _names_components(tracker, frames, shape):
        return marked(tracker, jnp.where(_as_bool(observed), frames, jnp.nan), None, first)
    if shape != (total,) and shape != (total, parts):
        if parts == 1 and len(shape) == 2:
            raise InputError(
                f"observed has shape {list(shape)}, and this model has one partition, which a "
                f"frame shows or not: give [{total}]; if single components of y are missing, let a "
                "log_likelihood that leaves NaN out say so by its attribute handles_nan = True."
            )
        of_parts = "" if parts is None else f", or which partitions, [{total}, {parts}]"
        raise InputError(
            f"observed has shape {shape}; say of each of the {total} frames whether it was seen, "
            f"[{total}]{of_parts}."
        )
    if len(shape) == 2:
        _check_parts(tracker)
    _check_nan(tracker, frames, observed, first)
    return WithGaps(tracker), (frames, _as_bool(observed))


def unmarked(tracker: Any, frames: Any) -> tuple[Any, Any]:
    """Undo ``marked``: return the original tracker and frames."""
    if not isinstance(tracker, WithGaps):
        return tracker, frames
    return tracker.tracker, frames if come_one_by_one(frames) else frames[0]


def marked_one_by_one(tracker: Any, frames: Any, observed: Any = None) -> Iterator[Any]:
    """Yield each frame, the tracker for it, and the frame in that tracker's format."""
    check_type("frames", frames, Iterable)
    if observed is not None:
        check_type("observed", observed, Iterable)
        check_gaps(tracker)
        for frame, seen in _pairs(tracker, frames, observed):
            yield frame, WithGaps(tracker), (frame, seen)
        return
    for number, frame in enumerate(frames):
        if frame is None:
            raise InputError(f"frame {number} is None, as an unreadable file gives; give arrays.")
        one = jax.tree.map(lambda x: np.asarray(x)[None], frame)
        marked_tracker = marked(tracker, one, first=number)[0]
        yield frame, marked_tracker, frame if marked_tracker is tracker else (frame, False)


def _pairs(tracker: Any, frames: Any, observed: Any) -> Iterator[Any]:
    shapes = (), (getattr(tracker, "num_partitions", None),)
    for frame, seen in itertools.zip_longest(frames, observed):
        if frame is None or seen is None or np.shape(seen) not in shapes:
            raise InputError(
                "observed must be one bool for each frame, or one for each of its partitions."
            )
        yield frame, _as_bool(seen)


def _names_components(tracker: Any, frames: Any, shape: tuple[int, ...]) -> bool:
    """Whether an ``observed`` of this shape names components of frames, not partitions."""
    parts = getattr(tracker, "num_partitions", None)
    return (
        len(shape) > 1
        and isinstance(frames, np.ndarray | jax.Array)
        and shape == frames.shape != (len(frames), parts)
        and contract.handles_nan(tracker)
    )


def _as_bool(observed: Any) -> Any:
    return observed.astype(bool) if isinstance(observed, jax.Array) else np.asarray(observed, bool)


def _seen(frames: Any) -> Any:
    """``[T]`` bool, which frames are not entirely NaN; None if all are seen."""
    leaves = jax.tree.leaves(frames)
    if not leaves or not all(jnp.issubdtype(jnp.result_type(x), jnp.floating) for x in leaves):
        return None
    if not is_concrete(frames):
        return ~_nan_throughout(jnp, leaves)
    # Within a user's trace, indexing a JAX array would give a tracer.
    leaves = [np.asarray(x) for x in leaves]
    # A frame that is entirely NaN starts with NaN, so only such frames must be read.
    first = [np.isnan(x[(slice(None), *[0] * (x.ndim - 1))]) for x in leaves]
    places = np.flatnonzero(np.all(first, axis=0))
    missing = np.zeros(len(leaves[0]), bool)
    if len(places):
        missing[places] = _nan_throughout(np, [x[places] for x in leaves])
    return ~missing if missing.any() else None


def _nan_throughout(library: Any, leaves: list[Any]) -> Any:
    of_leaves = [library.isnan(x).reshape(len(x), -1).all(axis=1) for x in leaves]
    return library.all(library.stack(of_leaves), axis=0)


def _check_nan(tracker: Any, frames: Any, seen: Any, first: int) -> None:
    """Refuse concrete frames, seen ``[T]`` or ``[T, P]``, of which a part is NaN.

    Raises:
        InputError: names the first such frame and the place in it.
    """
    if not is_concrete(frames, seen) or contract.handles_nan(tracker):
        return
    for path, leaf in jax.tree_util.tree_leaves_with_path(frames):
        if not jnp.issubdtype(jnp.result_type(leaf), jnp.floating):
            continue
        # Within a user's trace, indexing a JAX array would give a tracer.
        leaf = np.asarray(leaf)
        # The smallest number shows whether any is NaN, without a mask as large as the frames.
        if not leaf.size or not np.isnan(np.min(leaf)):
            continue
        is_nan = np.isnan(leaf).reshape(len(leaf), -1).any(axis=1)
        if seen is not None:
            is_nan &= np.asarray(seen, bool).reshape(len(leaf), -1).all(axis=1)
        if is_nan.any():
            frame = int(np.argmax(is_nan))
            place = np.argwhere(np.isnan(leaf[frame]))[0].tolist()
            raise InputError(
                f"frame {first + frame} holds NaN{jax.tree_util.keystr(path)} at {place}, but not "
                "only NaN; give observed= to say which frames or partitions are missing, or set "
                "handles_nan = True on a likelihood (or log_likelihood) that understands NaN."
            )


def _if_seen(seen: jax.Array, compute: Callable[[], Any]) -> Any:
    """``compute()`` if seen, else zeros of the same shapes."""

    def zeros() -> Any:
        return jax.tree.map(lambda x: jnp.zeros(x.shape, x.dtype), jax.eval_shape(compute))

    return lax.cond(seen, compute, zeros)


def _can_have_gaps(tracker: Any) -> bool:
    return hasattr(tracker, "likelihood") or (
        hasattr(tracker, "tracker") and _can_have_gaps(tracker.tracker)
    )


def check_gaps(tracker: Any) -> None:
    """Refuse a tracker that does not support missing frames.

    Raises:
        InputError: the tracker has no likelihood to skip.
    """
    if not _can_have_gaps(tracker):
        raise InputError(
            f"{type(tracker).__name__} has no field likelihood that could be left out where a "
            "frame is missing; give it one, or frames that were all seen."
        )


def _check_parts(tracker: Any) -> None:
    """Refuse a tracker that does not support missing partitions.

    Raises:
        InputError: particles hold one target each, or the joint likelihood takes no ``observed``.
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
