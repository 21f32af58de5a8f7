"""Which frames and partitions are missing: what a user says, or frames of NaN.

``jaxpf.running.gaps`` wraps a tracker so that it takes the marked frames.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxpf.contract import calls
from jaxpf.contract.errors import InputError
from jaxpf.contract.optional import likelihood_of, optional, unwrapped
from jaxpf.contract.pytree import is_concrete
from jaxpf.contract.types import TrackerLike
from jaxpf.running.frames import num_frames
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
