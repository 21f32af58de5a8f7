"""Many independent runs of any tracker, vectorised in blocks that several devices share."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.sharding import Mesh, NamedSharding, PartitionSpec

from jaxpf import contract
from jaxpf.contract.errors import InputError
from jaxpf.running import (
    as_keys,
    frame_step,
    init,
    missing_frames,
    num_frames,
    summary_only,
    together,
)
from jaxpf.running.checks import check_frames, check_run, check_whole
from jaxpf.running.chunks import come_one_by_one, in_chunks

#: Runs that are vectorised together, where many are asked for and where few are.  Five cost up to
#: a third more for each run than 25, but 25 for the sake of one cost ten times as much.
WIDE, NARROW = 25, 5
#: Runs left over that are dearer in narrow blocks than with a wide one filled up.
_MANY_LEFT = 20
#: ``((count, width), ...)``: blocks of runs that are vectorised together, one after another.
Blocks = tuple[tuple[int, int], ...]
_AXIS = "runs"
#: What several devices share: all have everything, or each its batches, or its frame of a group.
_REPLICATED, _OF_BATCHES = PartitionSpec(), PartitionSpec(_AXIS)
_OF_GROUPS = PartitionSpec(None, _AXIS)


def monte_carlo(
    tracker: Any,
    keys: jax.Array,
    frames: Any,
    record: Callable[[Any, Any], Any] = summary_only,
    batch_size: int | None = None,
    devices: Sequence[jax.Device] | None = None,
    frames_per_chunk: int | None = None,
    observed: Any = None,
) -> Any:
    """Track one sequence many times, independently.

    Runs are vectorised in blocks (``blocks_of``), whose width depends on the number of runs, not on
    devices or chunks.  A run's result depends on its key alone: bit for bit between blocks of one
    width, up to rounding between widths.  What depends on a frame alone (``tracker.observe``) is
    computed once per frame for all runs, on one device only.

    Frames travel to the devices in chunks, without changing a bit of the results: memory does not
    grow with T, except for what ``record`` keeps.

    On a CPU one device uses little more than one core.  More host devices use the others:
    ``jax.config.update("jax_num_cpu_devices", 2)`` before JAX is first used.

    Args:
        tracker: as for ``run``.
        keys: ``[R]`` keys, one per run.
        frames: as for ``run``; or an iterable of single frames, such as a generator, of which
            those of two chunks are kept at a time.
        record: as for ``run``.
        batch_size: width of all blocks, the last one filled up, so that results are the same bit
            for bit however many runs there are; by default it depends on their number.
        devices: the blocks are dealt out to them; default all of ``jax.local_devices()``.
        frames_per_chunk: rounded up to a multiple of the devices, and to two for each of them.
            By default as many as ``jaxpf.running.chunks.CHUNK_BYTES`` hold; and all of them, if
            they are
            on a device already.
        observed: as for ``run``.

    Returns:
        What ``record`` kept, with leading axes ``[R, T]``.

    Raises:
        InputError: as for ``run``; no keys; ``batch_size`` or ``frames_per_chunk`` < 1; no
            devices; frames that differ in shape.
    """
    if batch_size is not None:
        check_whole("batch_size", batch_size)
    keys = as_keys(keys)
    count = keys.shape[0]
    blocks = blocks_of(count) if batch_size is None else ((-(-count // batch_size), batch_size),)
    return run_blocks(tracker, keys, frames, blocks, record, devices, frames_per_chunk, observed)


def blocks_of(num_runs: int, asked: int | None = None) -> Blocks:
    """How runs are divided into blocks of at most two widths, by their number alone.

    Of 25 runs and more, blocks of 25, and the rest in blocks of 5, the last one filled up; of
    fewer, blocks of 5 and one of what is left.

    Args:
        num_runs: runs that are to be done.
        asked: runs of which these are what is left to do; by default these.
    """
    if (num_runs if asked is None else asked) < WIDE:
        blocks = (num_runs // NARROW, NARROW), (1, num_runs % NARROW)
    else:
        wide, left = divmod(num_runs, WIDE)
        if left >= _MANY_LEFT:
            wide, left = wide + 1, 0
        blocks = (wide, WIDE), (-(-left // NARROW), NARROW)
    return tuple((count, width) for count, width in blocks if count * width)


def run_blocks(
    tracker: Any,
    keys: jax.Array,
    frames: Any,
    blocks: Blocks,
    record: Callable[[Any, Any], Any] = summary_only,
    devices: Sequence[jax.Device] | None = None,
    frames_per_chunk: int | None = None,
    observed: Any = None,
) -> Any:
    """``monte_carlo`` in given blocks, of which the last may be filled up.

    Raises:
        InputError: as for ``monte_carlo``.
    """
    if not come_one_by_one(frames):
        check_frames(frames)
        num_frames(frames)
    tracker, frames = missing_frames.marked(tracker, frames, observed)
    devices = tuple(jax.local_devices() if devices is None else devices)
    if not devices:
        raise InputError("devices is empty; give at least one, or None for all there are.")
    used = devices[: max(count for count, _ in blocks)]
    # Of each group of blocks of one width: how many are runs, and the keys [B, W], filled up so
    # that every device has as many blocks.
    sizes, batches, first = [], [], 0
    for count, width in blocks:
        sizes.append(min(count * width, keys.shape[0] - first))
        places = np.arange(-(-count // len(used)) * len(used) * width)
        places = first + np.minimum(places, sizes[-1] - 1)
        batches.append(_taken(keys, places.reshape(-1, width)))
        first += sizes[-1]

    states, kept, length = None, [], 0
    for first, count, chunk in in_chunks(frames, frames_per_chunk, len(used)):
        of_chunk = tracker
        if come_one_by_one(frames):
            of_chunk, chunk = missing_frames.marked(
                tracker, chunk
            )  # only now is it known which are missing
        if states is None:
            check_run(*missing_frames.unmarked(of_chunk, chunk))
            states = _begin_compiled(tracker, batches, used)
        else:
            # One chunk is computed while the next one is read, and no more are waiting.
            jax.block_until_ready(kept[-1])
        times, groups = in_groups(first, chunk, used)
        states, recorded = _advance_compiled(of_chunk, batches, states, times, groups, record, used)
        kept.append(recorded)
        length = first + count

    if len(used) > 1:
        # XLA queues a limited number of computations per device.  What is asked of the results
        # before they are there can fill one device's places before the other's, and then devices
        # wait for one another for ever (seen: "all gather ... may be stuck").
        jax.block_until_ready(kept)
    return _joined(kept, tuple(sizes), length)


# Compiled as a whole: else JAX compiles every operation separately, at every start.
@jax.jit
def _taken(keys: jax.Array, places: np.ndarray) -> jax.Array:
    return keys[places]


@partial(jax.jit, static_argnames=("sizes", "length"))
def _joined(kept: list[Any], sizes: tuple[int, ...], length: int) -> Any:
    """What was kept of every chunk and width, as ``[R, T, ...]``."""

    def of_width(size: int, *chunks: jax.Array) -> jax.Array:
        whole = chunks[0] if len(chunks) == 1 else jnp.concatenate(chunks, axis=2)
        return whole.reshape(-1, *whole.shape[2:])[:size, :length]

    by_width = [
        jax.tree.map(partial(of_width, size), *chunks)
        for size, chunks in zip(sizes, zip(*kept, strict=True), strict=True)
    ]
    return jax.tree.map(lambda *parts: jnp.concatenate(parts), *by_width)


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


def begin_batches(tracker: Any, keys: Sequence[jax.Array], devices: tuple = ()) -> Any:
    """For each width the states ``[B, W, ...]`` of runs with keys ``[B, W]``, before any frame."""

    def begin(tracker, keys):
        return [lax.map(jax.vmap(lambda key: init(tracker, key)), of_width) for of_width in keys]

    if len(devices) > 1:
        begin = _on_devices(begin, devices, (_REPLICATED, _OF_BATCHES))
    return begin(tracker, keys)


def advance_batches(
    tracker: Any,
    keys: Sequence[jax.Array],
    states: Any,
    times: Any,
    groups: Any,
    record: Callable,
    devices: tuple = (),
) -> tuple[Any, Any]:
    """What ``monte_carlo`` compiles: states ``[B, W, ...]`` carried through a chunk of frames.

    Blocks come one after another, those of one width in a loop.  Several devices share them.  Of
    each group of as many frames, every device observes one and receives the others' observations.

    Args:
        tracker: as for ``run``.
        keys: for each width ``[B, W]``, the runs of a block together.
        states: before the chunk, for each width ``[B, W, ...]``.
        times: ``[G, D]``, see ``in_groups``; one device has groups of one frame.
        groups: ``[G, D, ...]``.
        record: as for ``run``.
        devices: D of them, or none for the only one.

    Returns:
        The states after the chunk, and what was kept, ``[B, W, G D, ...]`` for each width.
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
        def of_block(block):
            block_keys, block_states = block
            return together(tracker, block_keys)(advance, block_states)

        done = [lax.map(of_block, of_width) for of_width in zip(keys, states, strict=True)]
        return [state for state, _ in done], [kept for _, kept in done]

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
