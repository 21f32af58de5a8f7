"""Which frames and partitions are missing: what a user says, or frames of NaN.

``jaxpf.running.gaps`` wraps a tracker so that it takes the marked frames.
"""

import itertools
from collections.abc import Iterator
from types import ModuleType
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from jaxpf.contract import calls
from jaxpf.contract.errors import InputError
from jaxpf.contract.optional import likelihood_of, optional, unwrapped
from jaxpf.contract.pytree import is_concrete
from jaxpf.contract.types import TrackerLike
from jaxpf.running.frames import Frames, frames_of, num_frames
from jaxpf.running.gaps import WithGaps


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
        seen = _seen(frames)
        _check_nan(tracker, frames, seen, first)
        return (tracker, frames) if seen is None else (WithGaps(tracker), (frames, seen))
    seen, shape = _as_bool(observed), np.shape(observed)
    total, parts = num_frames(frames), optional(tracker, "num_partitions")
    of_components = len(shape) > 1 and shape == np.shape(frames) != (total, parts)
    if of_components and calls.handles_nan(tracker):
        return marked(tracker, jnp.where(seen, frames, jnp.nan), None, first)
    if shape not in ((total,), (total, parts)):
        raise InputError(
            f"observed has shape {list(shape)}; say of each of the {total} frames whether it was "
            f"seen, [{total}], or which partitions, [{total}, {parts}]; single components of y may "
            "be missing for a likelihood (or log_likelihood) with handles_nan = True."
        )
    if len(shape) == 2 and hasattr(filter_ := unwrapped(tracker), "population"):
        raise InputError(
            f"{type(filter_).__name__} compares particles of different targets, which a missing "
            "target would upset; give observed for whole frames, [T]."
        )
    _check_nan(tracker, frames, seen, first)
    return WithGaps(tracker), (frames, seen)


def marked_source(tracker: TrackerLike, frames: Frames, observed: Any) -> tuple[Any, Iterator[Any]]:
    """``marked`` for frames that come one by one."""
    each = marked_one_by_one(tracker, frames, observed)
    pairs = (taken if its is not tracker else (taken, True) for _, its, taken in each)
    return WithGaps(tracker), pairs


def unmarked(tracker: TrackerLike, frames: Any) -> tuple[Any, Any]:
    """Undo ``marked``: return the original tracker and frames."""
    return (tracker.tracker, frames[0]) if isinstance(tracker, WithGaps) else (tracker, frames)


def marked_one_by_one(tracker: TrackerLike, frames: Frames, observed: Any = None) -> Iterator[Any]:
    """Yield each frame, the tracker for it, and the frame in that tracker's format."""
    rows = () if observed is None else frames_of(observed).one_by_one()
    pairs = itertools.zip_longest(frames.one_by_one(), rows)
    for number, (frame, seen) in enumerate(pairs):
        if observed is not None and (frame is None or seen is None):
            raise InputError("observed must have one row for each frame.")
        if frame is None:
            raise InputError(f"frame {number} is None, as an unreadable file gives; give arrays.")
        one = jax.tree.map(lambda x: np.asarray(x)[None], frame)
        its, taken = marked(tracker, one, seen if seen is None else np.asarray(seen)[None], number)
        is_changed = seen is not None or its is not tracker
        yield frame, its, jax.tree.map(lambda x: x[0], taken) if is_changed else frame


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
    if not is_concrete(frames, seen) or calls.handles_nan(tracker):
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
