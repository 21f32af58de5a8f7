"""Missing frames: particles move by their dynamics and are not weighted.

Which frames and partitions are missing is what a user says, or frames of NaN.

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
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from jaxpf import contract
from jaxpf.contract import calls
from jaxpf.contract.calls import likelihood_of, optional, unwrapped
from jaxpf.contract.errors import InputError
from jaxpf.contract.pytree import is_concrete, pytree_dataclass
from jaxpf.contract.types import TrackerLike
from jaxpf.contract.wrapped import SUBSTATES
from jaxpf.running.frames import num_frames

#: Tolerated rounding of a sum of weights, in units in the last place: enough for several stages of
#: a million particles.
_ROUNDING = 1000
#: Optional methods of a likelihood that take substates and no observation.
_OF_STATES = frozenset({"reaches_border", "same_place", "sample"})


def marked(
    tracker: TrackerLike, frames: Any, observed: Any = None, first: int = 0
) -> tuple[Any, Any]:
    """Mark missing frames; return tracker and frames unchanged if none is missing.

    Args:
        tracker: any tracker.
        frames: pytree of arrays ``[T, ...]``.
        observed: ``[T]`` bool, which frames were seen, or ``[T, P]``, which partitions.  None: all
            frames except float frames that are entirely NaN; traced frames are tested at run time.
            In the shape of ``frames``: which components, for a likelihood that handles NaN.
        first: number of the first frame, for messages.

    Raises:
        InputError: ``observed`` has a wrong shape, the tracker does not support missing
            partitions, or a frame that was seen holds NaN.
    """
    if getattr(tracker, "is_marked", False) or (
        observed is None and likelihood_of(tracker) is None
    ):
        return tracker, frames
    if observed is None:
        some, every = _nan_in(frames)
        _check_nan(tracker, frames, some & ~every, first)
        if is_concrete(every) and not np.any(every):
            return tracker, frames
        return WithGaps(tracker), (frames, ~every)
    seen = np.asarray(observed, bool) if is_concrete(observed) else observed.astype(bool)
    total, parts = num_frames(frames), optional(tracker, "num_partitions")
    of_components = seen.ndim > 1 and seen.shape == np.shape(frames) != (total, parts)
    if of_components and calls.handles_nan(tracker):
        return marked(tracker, jnp.where(seen, frames, jnp.nan), None, first)
    if seen.shape not in ((total,), (total, parts)):
        raise InputError(
            f"observed has shape {list(seen.shape)}; say of each of the {total} frames whether it "
            f"was seen, [{total}], or which partitions, [{total}, {parts}]; single components of y "
            "may be missing for a likelihood (or log_likelihood) with handles_nan = True."
        )
    if seen.ndim == 2 and hasattr(filter_ := unwrapped(tracker), "population"):
        raise InputError(
            f"{type(filter_).__name__} compares particles of different targets, which a missing "
            "target would upset; give observed for whole frames, [T]."
        )
    _check_nan(tracker, frames, _nan_in(frames)[0] & seen.reshape(total, -1).all(axis=1), first)
    return WithGaps(tracker), (frames, seen)


def unmarked(tracker: TrackerLike) -> Any:
    """The tracker that ``marked`` was given."""
    return tracker.tracker if isinstance(tracker, WithGaps) else tracker


def _nan_in(frames: Any) -> tuple[Any, Any]:
    """``[T]`` bool each: which frames hold NaN, and which nothing else."""
    library = np if is_concrete(frames) else jnp  # JAX would return tracers inside a user's trace
    leaves = list(map(library.asarray, jax.tree.leaves(frames)))
    floats = [leaf for leaf in leaves if jnp.issubdtype(leaf.dtype, jnp.floating)]
    some = np.zeros(num_frames(frames), bool)
    every: Any = ~some if len(floats) == len(leaves) else some
    for leaf in floats:
        # The smallest number shows whether any is NaN, without a mask as large as the frames.
        if library is np and not np.isnan(np.min(leaf, initial=np.inf)):
            every = np.zeros_like(every)
            continue
        is_nan = library.isnan(leaf).reshape(len(leaf), -1)
        some, every = some | is_nan.any(axis=1), every & is_nan.all(axis=1)
    return some, every


def _check_nan(tracker: TrackerLike, frames: Any, partly: Any, first: int) -> None:
    """Refuse frames that are NaN in part, ``[T]`` bool, where the frames are known."""
    if calls.handles_nan(tracker) or not is_concrete(partly) or not np.any(partly):
        return
    frame = int(np.argmax(partly))
    for path, leaf in jax.tree_util.tree_leaves_with_path(frames):
        leaf = np.asarray(leaf)[frame]
        if jnp.issubdtype(leaf.dtype, jnp.floating) and np.isnan(leaf).any():
            raise InputError(
                f"frame {first + frame} holds NaN{jax.tree_util.keystr(path)} at "
                f"{np.argwhere(np.isnan(leaf))[0].tolist()}, but not only NaN; give observed= to "
                "say which frames or partitions are missing, or set handles_nan = True on a "
                "likelihood (or log_likelihood) that understands NaN."
            )


@pytree_dataclass
class LikelihoodWithGaps(contract.WrappedLikelihood):
    """A likelihood of frames ``(frame, seen)``; ``seen`` is bool ``[]``, or ``[P]`` by partition.

    With ``[P]``, the inner ``log_joint`` gets ``observed=seen``.

    Attributes:
        likelihood: the inner likelihood.
    """

    likelihood: Any

    def passed_on(self, name, method, *arguments):
        """Call an optional method if the frame was seen; else return zeros."""
        if name in _OF_STATES:
            return method(*arguments)
        first, *rest = arguments
        if name == "observe_nearby":
            return self._observed(first, lambda frame: method(frame, *rest))
        observation, seen = first
        if name == "look_near":
            return _if_seen(seen.any(), lambda: method(observation, *rest)), seen
        if not seen.ndim:
            return _if_seen(seen, lambda: method(observation, *rest))
        if name.startswith("log_joint"):
            return method(observation, *rest, observed=seen)
        counts = seen.all() if name == "log_first_stage" else seen[rest[0]]
        return jnp.where(counts, method(observation, *rest), 0)

    def as_seen(self, observation):
        """See ``jaxpf.contract.calls.as_seen``."""
        return self.likelihood, *observation

    def observe(self, frame):
        """The inner observation of a frame, zeros if it was not seen."""
        return self._observed(frame, self.likelihood.observe)

    def _observed(self, frame, observe):
        frame, seen = frame
        seen = jnp.asarray(seen)
        can_be_nan = optional(self.likelihood, "handles_nan")

        def without_nan(x):
            # The compiler may compute both branches, so the unused one must not see NaN.
            x = jnp.where(seen.any(), x, jnp.zeros_like(x))
            is_part = seen.ndim and not can_be_nan and jnp.issubdtype(x.dtype, jnp.floating)
            return jnp.where(jnp.isnan(x), 0, x) if is_part else x

        frame = jax.tree.map(without_nan, frame)
        return _if_seen(seen.any(), lambda: observe(frame)), seen

    def log_prob_all(self, observation, partition, substates):
        """The inner log-likelihoods ``[N]``, 0 for frames or partitions that were not seen."""
        observation, seen = observation

        def inner():
            return contract.log_prob_all(self.likelihood, observation, partition, substates)

        if seen.ndim:
            return jnp.where(calls.of_partition(seen, partition), inner(), 0)
        return _if_seen(seen, inner)


@pytree_dataclass
class LikelihoodOfNoFrame(LikelihoodWithGaps):
    """A likelihood for runs in which all frames are missing."""

    def passed_on(self, name, method, *arguments):
        """Call an optional method of states alone; the others see nothing, and return zeros."""
        if name in _OF_STATES:
            return method(*arguments)
        if name in ("look_near", "observe_nearby"):
            return ()
        substates = arguments[SUBSTATES[name][0]]
        every = name.endswith("_all")
        return jnp.zeros(substates.shape[-1:] if every else (), substates.dtype)

    def as_seen(self, observation):
        """See ``jaxpf.contract.calls.as_seen``: nothing was seen."""
        return self.likelihood, None, np.False_

    def observe(self, frame):
        """Ignore the frame."""
        return ()

    def log_prob_all(self, observation, partition, substates):
        """0 for every particle, ``[N]``."""
        return jnp.zeros(substates.shape[-1:], substates.dtype)


@pytree_dataclass
class WithGaps(contract.WrappedTracker):
    """A tracker of frames ``(frame, seen)``; ``seen`` is bool ``[]`` or ``[P]``.

    In a missing frame, ``log_evidence`` is the filter's log total weight, exactly 0 if it is 0 by
    construction, and confidence does not change.

    Attributes:
        tracker: has a ``likelihood``, or a ``tracker`` that has one.
    """

    tracker: Any

    is_marked = True
    _wraps = LikelihoodWithGaps

    def observe(self, frame):
        """Return the tracker's observation of a frame, and whether it was seen."""
        inner = calls.changed_inside(self.tracker, "likelihood", self._wraps)
        return calls.observed_apart(inner)[0](frame), jnp.asarray(frame[1])

    def step_observed(self, key, state, observation):
        """Return the tracker's next state and summary."""
        observation, seen = observation
        step = calls.observed_apart(calls.changed_inside(self.tracker, "likelihood", self._wraps))[
            1
        ]
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


def _if_seen(seen: jax.Array, compute: Callable[[], Any]) -> Any:
    """``compute()`` if seen, else zeros of the same shapes."""

    def zeros() -> Any:
        return jax.tree.map(lambda x: jnp.zeros(x.shape, x.dtype), jax.eval_shape(compute))

    return lax.cond(seen, compute, zeros)
