"""Running any tracker: over the frames of a sequence, and over many independent runs."""

from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
from jax import lax

from jaxpf.errors import InputError

#: Runs per compiled batch of ``monte_carlo``.
RUNS_PER_BATCH = 25


def summary_only(state: Any, summary: Any) -> Any:
    """The default of ``record``: keep the summary of every frame."""
    return summary


def run(
    tracker: Any, key: jax.Array, frames: Any, record: Callable[[Any, Any], Any] = summary_only
) -> tuple[Any, Any]:
    """Track one sequence once.

    Args:
        tracker: any object with ``init`` and ``step``, registered as a pytree.
        key: the run's random key; frame t uses ``fold_in(key, t + 1)``.
        frames: array or pytree with a leading time axis ``[T, ...]``.
        record: function of ``(state, summary)``, what to keep of each frame.  Pass a
            named function: a new lambda compiles anew.

    Returns:
        The final state, and what ``record`` kept, with a leading axis T.

    Raises:
        InputError: no frames, or arrays with different numbers of frames.
    """
    _num_frames(frames)
    return _run(tracker, key, frames, record)


def monte_carlo(
    tracker: Any,
    keys: jax.Array,
    frames: Any,
    record: Callable[[Any, Any], Any] = summary_only,
    batch_size: int = RUNS_PER_BATCH,
) -> Any:
    """Track one sequence many times, independently.

    Runs are processed in batches of one fixed width, the last one padded, so that a run's
    result depends on its key alone, bit for bit, and not on how many other runs there
    are.  What depends on a frame alone (``tracker.observe``) is computed once per frame
    for all runs.  Memory does not grow with T, but for what ``record`` keeps.

    Args:
        tracker: as for ``run``.
        keys: ``[R]`` keys, one per run.
        frames: as for ``run``.
        record: as for ``run``.
        batch_size: runs that are vectorised together.  Results are reproducible bit for
            bit only among calls with the same ``batch_size``.

    Returns:
        What ``record`` kept, with leading axes ``[R, T]``.

    Raises:
        InputError: as for ``run``; no keys; ``batch_size`` < 1.
    """
    _num_frames(frames)
    keys = jnp.asarray(keys)
    if not jax.dtypes.issubdtype(keys.dtype, jax.dtypes.prng_key):
        keys = jax.random.wrap_key_data(keys)
    if keys.ndim != 1 or keys.shape[0] == 0:
        raise InputError(
            f"keys has shape {keys.shape}; give one key per run, as jax.random.split(key, R) does."
        )
    if batch_size < 1:
        raise InputError(f"batch_size={batch_size} must be at least 1.")
    num_runs = keys.shape[0]
    padding = -num_runs % batch_size
    padded = keys[jnp.minimum(jnp.arange(num_runs + padding), num_runs - 1)]
    recorded = _monte_carlo(tracker, padded.reshape(-1, batch_size), frames, record)
    return jax.tree.map(lambda x: x.reshape(num_runs + padding, *x.shape[2:])[:num_runs], recorded)


def frame_key(key: jax.Array, time: Any) -> jax.Array:
    """The key of frame ``time`` (from 0) of a run; key 0 is kept for ``init``."""
    return jax.random.fold_in(key, time + 1)


def init(tracker: Any, key: jax.Array) -> Any:
    """A run's state just before its first frame, as ``run`` makes it."""
    return tracker.init(jax.random.fold_in(key, 0))


def _num_frames(frames: Any) -> int:
    leaves = jax.tree.leaves(frames)
    lengths = {jnp.shape(leaf)[0] if jnp.ndim(leaf) else 0 for leaf in leaves}
    if len(lengths) != 1 or 0 in lengths:
        raise InputError(
            f"frames have leading axes {sorted(lengths)}; give at least one frame, and the same "
            "number of frames in every array."
        )
    return lengths.pop()


@partial(jax.jit, static_argnames="record")
def _run(tracker, key, frames, record):
    def body(state, item):
        time, frame = item
        state, summary = tracker.step(frame_key(key, time), state, frame)
        return state, record(state, summary)

    times = jnp.arange(_num_frames(frames))
    return lax.scan(body, init(tracker, key), (times, frames))


@partial(jax.jit, static_argnames="record")
def _monte_carlo(tracker, keys, frames, record):
    """``keys`` ``[B, W]``: batches one after another, the runs of a batch together."""
    observe, step = _split(tracker)

    def batch_step(time, observation):
        def step_one(key, state):
            state, summary = step(frame_key(key, time), state, observation)
            return state, record(state, summary)

        return lambda item: jax.vmap(step_one)(*item)

    def body(states, item):
        time, frame = item
        return lax.map(batch_step(time, observe(frame)), (keys, states))

    states = lax.map(jax.vmap(lambda key: init(tracker, key)), keys)
    times = jnp.arange(_num_frames(frames))
    _, recorded = lax.scan(body, states, (times, frames))
    return jax.tree.map(lambda x: jnp.moveaxis(x, 0, 2), recorded)


def _split(tracker: Any) -> tuple[Callable, Callable]:
    """The part of a step that depends on the frame alone, and the rest."""
    if hasattr(tracker, "observe") and hasattr(tracker, "step_observed"):
        return tracker.observe, tracker.step_observed
    return (lambda frame: frame), tracker.step
