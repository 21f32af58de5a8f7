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
from jax.sharding import Mesh, NamedSharding, PartitionSpec

from jaxpf import contract
from jaxpf.checks import check_frames, check_run
from jaxpf.chunks import come_one_by_one, in_chunks
from jaxpf.errors import InputError

#: Runs per compiled batch of ``monte_carlo``.
RUNS_PER_BATCH = 25
_AXIS = "runs"
#: What several devices share: all have everything, or each its batches, or its frame of a group.
_REPLICATED, _OF_BATCHES = PartitionSpec(), PartitionSpec(_AXIS)
_OF_GROUPS = PartitionSpec(None, _AXIS)


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
        InputError: no frames, arrays with different numbers of frames, or frames that come one by
            one; see also ``jaxpf.checks.check_run``.
    """
    if come_one_by_one(frames):
        raise InputError(
            "frames come one by one, and run needs them all at once; use jaxpf.streaming.stream or "
            "jaxpf.monte_carlo, which keep few of them, or give np.stack(list(frames))."
        )
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
    frames_per_chunk: int | None = None,
) -> Any:
    """Track one sequence many times, independently.

    Runs are processed in batches of one fixed width, the last one padded, so that a run's
    result depends on its key alone, bit for bit, and not on how many other runs or devices
    there are.  What depends on a frame alone (``tracker.observe``) is computed once per
    frame for all runs, and on one device only.

    Frames travel to the devices in chunks, and states are carried from chunk to chunk: results
    are the same bit for bit, and memory does not grow with T, but for what ``record`` keeps.

    On a CPU one device uses little more than one core.  More host devices use the others:
    ``jax.config.update("jax_num_cpu_devices", 2)`` before JAX is first used.

    Args:
        tracker: as for ``run``.
        keys: ``[R]`` keys, one per run.
        frames: as for ``run``; or an iterable of single frames, such as a generator, of which
            those of two chunks are kept at a time.
        record: as for ``run``.
        batch_size: runs that are vectorised together.  Results are reproducible bit for
            bit only among calls with the same ``batch_size``.
        devices: the batches are dealt out to them; default all of ``jax.local_devices()``.
        frames_per_chunk: rounded up to a multiple of the devices, and to two for each of them.
            By default as many as ``jaxpf.chunks.CHUNK_BYTES`` hold; and all of them, if they are
            on a device already.

    Returns:
        What ``record`` kept, with leading axes ``[R, T]``.

    Raises:
        InputError: as for ``run``; no keys; ``batch_size`` or ``frames_per_chunk`` < 1; no
            devices; frames that differ in shape.
    """
    if not come_one_by_one(frames):
        check_frames(frames)
        num_frames(frames)
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

    states, kept, length = None, [], 0
    for first, count, chunk in in_chunks(frames, frames_per_chunk, len(used)):
        if states is None:
            check_run(tracker, chunk)
            states = _begin_compiled(tracker, batches, used)
        else:
            # One chunk is computed while the next one is read, and no more are waiting.
            jax.block_until_ready(kept[-1])
        times, groups = in_groups(first, chunk, used)
        states, recorded = _advance_compiled(tracker, batches, states, times, groups, record, used)
        kept.append(recorded)
        length = first + count

    def joined(*parts: jax.Array) -> jax.Array:
        whole = parts[0] if len(parts) == 1 else jnp.concatenate(parts, axis=2)
        return whole.reshape(num_runs + padding, *whole.shape[2:])[:num_runs, :length]

    return jax.tree.map(joined, *kept)


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


def in_groups(first: int, frames: Any, devices: tuple) -> tuple[np.ndarray, Any]:
    """Times ``[G, D]`` and frames ``[G, D, ...]``: in groups of as many as there are devices.

    Each device is given the frames that it observes, and no others.

    Args:
        first: time of the first frame.
        frames: ``[G D, ...]``.
        devices: D of them, or none for the only one.
    """
    length, count = num_frames(frames), max(len(devices), 1)
    times = np.arange(first, first + length, dtype=np.int32).reshape(-1, count)
    groups = jax.tree.map(lambda x: x.reshape(-1, count, *x.shape[1:]), frames)
    if count > 1:
        groups = jax.device_put(groups, NamedSharding(_mesh(devices), _OF_GROUPS))
    return times, groups


def begin_batches(tracker: Any, keys: jax.Array, devices: tuple = ()) -> Any:
    """States ``[B, W, ...]`` of runs with keys ``[B, W]``, just before the first frame."""

    def begin(tracker, keys):
        return lax.map(jax.vmap(lambda key: init(tracker, key)), keys)

    if len(devices) > 1:
        begin = _on_devices(begin, devices, (_REPLICATED, _OF_BATCHES))
    return begin(tracker, keys)


def advance_batches(
    tracker: Any,
    keys: jax.Array,
    states: Any,
    times: Any,
    groups: Any,
    record: Callable,
    devices: tuple = (),
) -> tuple[Any, Any]:
    """What ``monte_carlo`` compiles: states ``[B, W, ...]`` carried through a chunk of frames.

    Batches come one after another.  Several devices share them.  Of each group of as many frames,
    every device observes one and receives the others' observations.

    Args:
        tracker: as for ``run``.
        keys: ``[B, W]``, the runs of a batch together.
        states: before the chunk.
        times: ``[G, D]``, see ``in_groups``; one device has groups of one frame.
        groups: ``[G, D, ...]``.
        record: as for ``run``.
        devices: D of them, or none for the only one.

    Returns:
        The states after the chunk, and what was kept, ``[B, W, G D, ...]``.
    """
    advance: Callable = partial(
        _advance_on_one_device, record=record, num_devices=max(len(devices), 1)
    )
    if len(devices) > 1:
        places = (_REPLICATED, _OF_BATCHES, _OF_BATCHES, _REPLICATED, _OF_GROUPS)
        advance = _on_devices(advance, devices, places)
    return advance(tracker, keys, states, times, groups)


_begin_compiled = partial(jax.jit, static_argnames="devices")(begin_batches)
_advance_compiled = partial(jax.jit, static_argnames=("record", "devices"))(advance_batches)


def _mesh(devices: tuple) -> Mesh:
    return Mesh(np.asarray(devices), (_AXIS,))


def _on_devices(function: Callable, devices: tuple, places: tuple) -> Callable:
    return jax.shard_map(
        function, mesh=_mesh(devices), in_specs=places, out_specs=_OF_BATCHES, check_vma=False
    )


def _advance_on_one_device(tracker, keys, states, times, groups, record, num_devices):
    observe = contract.observed_apart(tracker)[0]

    def observe_group(group):
        mine = observe(jax.tree.map(lambda x: x[0], group))
        if num_devices == 1:
            return jax.tree.map(lambda x: x[None], mine)
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

    states, recorded = lax.scan(group_step, states, (times, groups))

    def by_run(x):
        return jnp.moveaxis(x.reshape(times.size, *x.shape[2:]), 0, 2)

    return states, jax.tree.map(by_run, recorded)
