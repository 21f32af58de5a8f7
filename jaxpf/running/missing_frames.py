"""Which frames and partitions are missing: what a user says, or frames of NaN.

``jaxpf.running.gaps`` wraps a tracker so that it takes the marked frames.
"""

import inspect
import itertools
from collections.abc import Iterable, Iterator
from types import ModuleType
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from jaxpf import contract
from jaxpf.contract.errors import InputError, check_type
from jaxpf.contract.numbers import check_array, with_nan
from jaxpf.contract.pytree import is_concrete
from jaxpf.contract.types import TrackerLike
from jaxpf.running.chunks import come_one_by_one
from jaxpf.running.gaps import WithGaps


def marked(
    tracker: TrackerLike, frames: Any, observed: Any = None, first: int = 0
) -> tuple[Any, Any]:
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
    if getattr(tracker, "is_marked", False):
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
        each = marked_one_by_one(tracker, frames, observed)
        pairs = (taken if its is not tracker else (taken, True) for _, its, taken in each)
        return WithGaps(tracker), pairs
    total, parts = len(jax.tree.leaves(frames)[0]), contract.optional(tracker, "num_partitions")
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


def unmarked(tracker: TrackerLike, frames: Any) -> tuple[Any, Any]:
    """Undo ``marked``: return the original tracker and frames."""
    if not isinstance(tracker, WithGaps):
        return tracker, frames
    return tracker.tracker, frames if come_one_by_one(frames) else frames[0]


def marked_one_by_one(tracker: TrackerLike, frames: Any, observed: Any = None) -> Iterator[Any]:
    """Yield each frame, the tracker for it, and the frame in that tracker's format."""
    check_type("frames", frames, Iterable)
    frames = (jax.tree.map(with_nan, frame) for frame in frames)
    if observed is not None:
        check_type("observed", observed, Iterable)
    pairs = itertools.zip_longest(frames, () if observed is None else observed)
    for number, (frame, seen) in enumerate(pairs):
        if observed is not None and (frame is None or seen is None):
            raise InputError("observed must have one row for each frame.")
        if frame is None:
            raise InputError(f"frame {number} is None, as an unreadable file gives; give arrays.")
        one = jax.tree.map(lambda x: np.asarray(x)[None], frame)
        its, taken = marked(tracker, one, seen if seen is None else np.asarray(seen)[None], number)
        is_changed = seen is not None or its is not tracker
        yield frame, its, jax.tree.map(lambda x: x[0], taken) if is_changed else frame


def _names_components(tracker: TrackerLike, frames: Any, shape: tuple[int, ...]) -> bool:
    """Whether an ``observed`` of this shape names components of frames, not partitions."""
    parts = contract.optional(tracker, "num_partitions")
    return (
        len(shape) > 1
        and isinstance(frames, np.ndarray | jax.Array)
        and shape == frames.shape != (len(frames), parts)
        and contract.handles_nan(tracker)
    )


def _as_bool(observed: ArrayLike) -> np.ndarray | jax.Array:
    return observed.astype(bool) if isinstance(observed, jax.Array) else np.asarray(observed, bool)


def _seen(frames: Any) -> np.ndarray | jax.Array | None:
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


def _nan_throughout(library: ModuleType, leaves: list[Any]) -> Any:
    of_leaves = [library.isnan(x).reshape(len(x), -1).all(axis=1) for x in leaves]
    return library.all(library.stack(of_leaves), axis=0)


def _check_nan(tracker: TrackerLike, frames: Any, seen: Any, first: int) -> None:
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


def _can_have_gaps(tracker: TrackerLike) -> bool:
    return contract.likelihood_of(tracker) is not None


def check_gaps(tracker: TrackerLike) -> None:
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
    filter_ = contract.filter_of(tracker)
    if hasattr(filter_, "population"):
        raise InputError(
            f"{type(filter_).__name__} compares particles of different targets, which a missing "
            "target would upset; give observed for whole frames, [T]."
        )
    likelihood = filter_.likelihood
    for name in contract.SUBSTATES:
        joint = contract.optional(likelihood, name) if name.startswith("log_joint") else None
        if joint and "observed" not in inspect.signature(joint).parameters:
            raise InputError(
                f"{type(likelihood).__name__}.{name} does not say what a missing partition means; "
                "give it an argument observed [P], or observed for whole frames, [T]."
            )
