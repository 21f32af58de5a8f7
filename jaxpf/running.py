"""Running any tracker: over the frames of a sequence, and over many independent runs.

There is one loop over frames, ``frame_step``.  One run, batches of runs on several devices, a
video's frames as they come and objectives that are differentiated arrange the runs as they need.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.sharding import Mesh, PartitionSpec

from jaxpf import contract
from jaxpf.checks import check_frames, check_run
from jaxpf.errors import InputError

#: Runs per compiled batch of ``monte_carlo``.
RUNS_PER_BATCH = 25
_AXIS = "runs"


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
        InputError: no frames, or arrays with different numbers of frames; see also
            ``jaxpf.checks.check_run``.
    """
    check_frames(frames)
    num_frames(frames)
    check_run(tracker, frames)
    return run_compiled(tracker, key, frames, record)


def monte_carlo(
    tracker: Any,
    keys: jax.Array,
    frames: Any,
    record: Callable[[Any, Any], Any] = summary_only,
    batch_size: int = RUNS_PER_BATCH,
    devices: Sequence[jax.Device] | None = None,
) -> Any:
    """Track one sequence many times, independently.

    Runs are processed in batches of one fixed width, the last one padded, so that a run's
    result depends on its key alone, bit for bit, and not on how many other runs or devices
    there are.  What depends on a frame alone (``tracker.observe``) is computed once per
    frame for all runs, and on one device only.  Memory does not grow with T, but for what
    ``record`` keeps.

    On a CPU one device uses little more than one core.  More host devices use the others:
    ``jax.config.update("jax_num_cpu_devices", 2)`` before JAX is first used.

    Args:
        tracker: as for ``run``.
        keys: ``[R]`` keys, one per run.
        frames: as for ``run``.
        record: as for ``run``.
        batch_size: runs that are vectorised together.  Results are reproducible bit for
            bit only among calls with the same ``batch_size``.
        devices: the batches are dealt out to them; default all of ``jax.local_devices()``.

    Returns:
        What ``record`` kept, with leading axes ``[R, T]``.

    Raises:
        InputError: as for ``run``; no keys; ``batch_size`` < 1; no devices.
    """
    check_frames(frames)
    num_frames(frames)
    check_run(tracker, frames)
    keys = as_keys(keys)
    if batch_size < 1:
        raise InputError(f"batch_size={batch_size} must be at least 1.")
    devices = tuple(jax.local_devices() if devices is None else devices)
    if not devices:
        raise InputError("devices is empty; give at least one, or None for all there are.")
    num_runs = keys.shape[0]
    used = devices[: -(-num_runs // batch_size)]
    padding = -num_runs % (batch_size * len(used))
    padded = keys[jnp.minimum(jnp.arange(num_runs + padding), num_runs - 1)]
    batches = padded.reshape(-1, batch_size)
    recorded = batches_compiled(tracker, batches, frames, record, used)
    return jax.tree.map(lambda x: x.reshape(num_runs + padding, *x.shape[2:])[:num_runs], recorded)


def frame_key(key: jax.Array, time: Any) -> jax.Array:
    """The key of frame ``time`` (from 0) of a run; key 0 is kept for ``init``."""
    return jax.random.fold_in(key, time + 1)


def init(tracker: Any, key: jax.Array) -> Any:
    """A run's state just before its first frame, as ``run`` makes it."""
    return tracker.init(jax.random.fold_in(key, 0))


def as_keys(keys: jax.Array) -> jax.Array:
    """One typed key per run, ``[R]``, also from keys of the old kind.

    Raises:
        InputError: no keys, or an array of another shape.
    """
    keys = jnp.asarray(keys)
    if not jax.dtypes.issubdtype(keys.dtype, jax.dtypes.prng_key):
        keys = jax.random.wrap_key_data(keys)
    if keys.ndim != 1 or keys.shape[0] == 0:
        raise InputError(
            f"keys has shape {keys.shape}; give one key per run, as jax.random.split(key, R) does."
        )
    return keys


def num_frames(frames: Any) -> int:
    """Length of the leading axis of all arrays.

    Raises:
        InputError: no frames, or arrays with different numbers of frames.
    """
    leaves = jax.tree.leaves(frames)
    lengths = {jnp.shape(leaf)[0] if jnp.ndim(leaf) else 0 for leaf in leaves}
    if len(lengths) != 1 or 0 in lengths:
        raise InputError(
            f"frames have leading axes {sorted(lengths)}; give at least one frame, and the same "
            "number of frames in every array."
        )
    return lengths.pop()


def frame_step(
    observe: Callable[[Any], Any],
    of_every_run: Callable[[Callable, Any], Any],
    record: Callable[[Any, Any], Any],
) -> Callable[[Any, Any], Any]:
    """What every loop over frames repeats: observe a frame once, and advance all runs by it.

    Args:
        observe: a frame as the likelihood needs it.
        of_every_run: function of ``(advance, states)`` that applies ``advance(tracker, key,
            state)`` to every run, in whatever arrangement the states have, and returns what it
            returns: the new states, and what is kept.
        record: as for ``run``.

    Returns:
        Function of ``states`` and ``(time, frame)``, as ``lax.scan`` takes it, that returns the
        new states and what is kept of the frame.
    """

    def step_all(states: Any, item: Any) -> Any:
        time, frame = item
        observation = observe(frame)

        def advance(tracker: Any, key: jax.Array, state: Any) -> Any:
            step = contract.observed_apart(tracker)[1]
            state, summary = step(frame_key(key, time), state, observation)
            return state, record(state, summary)

        return of_every_run(advance, states)

    return step_all


def one_run(tracker: Any, key: jax.Array, record: Callable[[Any, Any], Any]) -> Callable:
    """The ``frame_step`` of a single run, whose states are one state."""
    observe = contract.observed_apart(tracker)[0]
    return frame_step(observe, lambda advance, state: advance(tracker, key, state), record)


def together(tracker: Any, keys: jax.Array) -> Callable[[Callable, Any], Any]:
    """``of_every_run`` for runs of one tracker that are vectorised, keys and states ``[R]``."""

    def of_every_run(advance: Callable, states: Any) -> Any:
        return jax.vmap(partial(advance, tracker))(keys, states)

    return of_every_run


@partial(jax.jit, static_argnames="record")
def run_compiled(tracker: Any, key: jax.Array, frames: Any, record: Callable) -> Any:
    """``run`` without its checks."""
    times = jnp.arange(num_frames(frames))
    return lax.scan(one_run(tracker, key, record), init(tracker, key), (times, frames))


def run_batches(
    tracker: Any, keys: jax.Array, frames: Any, record: Callable, devices: tuple = ()
) -> Any:
    """What ``monte_carlo`` compiles: ``keys`` ``[B, W]``, the runs of a batch together.

    Batches come one after another.  Several devices share them.  Of each group of as many frames,
    every device observes one and receives the others' observations.
    """
    if len(devices) <= 1:
        return _batches_of_one_device(tracker, keys, frames, record, 1)
    replicated, sharded = PartitionSpec(), PartitionSpec(_AXIS)
    return jax.shard_map(
        partial(_batches_of_one_device, record=record, num_devices=len(devices)),
        mesh=Mesh(np.asarray(devices), (_AXIS,)),
        in_specs=(replicated, sharded, replicated),
        out_specs=sharded,
        check_vma=False,
    )(tracker, keys, frames)


batches_compiled = partial(jax.jit, static_argnames=("record", "devices"))(run_batches)


def _batches_of_one_device(tracker, keys, frames, record, num_devices):
    observe = contract.observed_apart(tracker)[0]

    def observe_group(group):
        if num_devices == 1:
            return jax.tree.map(lambda x: x[None], observe(jax.tree.map(lambda x: x[0], group)))
        mine = observe(jax.tree.map(lambda x: x[lax.axis_index(_AXIS)], group))
        return jax.tree.map(lambda x: lax.all_gather(x, _AXIS), mine)

    def of_every_run(advance, states):
        def of_batch(batch):
            batch_keys, batch_states = batch
            return together(tracker, batch_keys)(advance, batch_states)

        return lax.map(of_batch, (keys, states))

    def group_step(states, item):
        times, group = item
        # Frames of a group are observed all at once: what is left is to find each one's.
        find = partial(contract.frame_of, observe_group(group))
        return lax.scan(
            frame_step(find, of_every_run, record), states, (times, jnp.arange(num_devices))
        )

    length = num_frames(frames)
    num_groups = -(-length // num_devices)
    # The last group is filled up with its last frame; what comes of it is dropped.
    times = jnp.minimum(jnp.arange(num_groups * num_devices), length - 1)
    if length % num_devices:
        frames = jax.tree.map(lambda x: jnp.asarray(x)[times], frames)
    groups = jax.tree.map(lambda x: x.reshape(num_groups, num_devices, *x.shape[1:]), frames)
    states = lax.map(jax.vmap(lambda key: init(tracker, key)), keys)
    _, recorded = lax.scan(group_step, states, (times.reshape(num_groups, num_devices), groups))

    def by_run(x):
        return jnp.moveaxis(x.reshape(num_groups * num_devices, *x.shape[2:])[:length], 0, 2)

    return jax.tree.map(by_run, recorded)
