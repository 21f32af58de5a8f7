"""Many independent runs of any tracker, vectorised in blocks across devices."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.sharding import Mesh, NamedSharding, PartitionSpec

from jaxpf.contract import calls
from jaxpf.contract.numbers import check_whole
from jaxpf.contract.pytree import is_concrete
from jaxpf.contract.recognised import recognised
from jaxpf.contract.types import TrackerLike
from jaxpf.lowering import platform
from jaxpf.lowering.programs import compiled
from jaxpf.running import missing_frames
from jaxpf.running.chunks import in_chunks
from jaxpf.running.cores import num_idle_cores, say_that_cores_are_idle
from jaxpf.running.frames import Frames, frames_of, noted, num_frames, warn_of_frames
from jaxpf.running.runs import as_key, frame_step, init, summary_only, together, with_rows

#: Block widths for many and for few runs on a CPU, whose cache they suit.  A block of 5 costs up to
#: a third more per run than one of 25, but computing 25 runs to get one costs ten times as much.
WIDE, NARROW = 25, 5
#: From this number of remaining runs, one padded wide block is cheaper than narrow blocks.
_MANY_LEFT = 20
#: Largest width on an accelerator, which is halved if memory runs out.
_ON_ACCELERATOR = 1024
#: ``((count, width), ...)``: ``count`` blocks of ``width`` vectorised runs, in sequence.
Blocks = tuple[tuple[int, int], ...]
_AXIS = "runs"
#: Sharding over devices: everything replicated, or split by batch, or by frame of a group.
_REPLICATED, _OF_BATCHES = PartitionSpec(), PartitionSpec(_AXIS)
_OF_GROUPS = PartitionSpec(None, _AXIS)


def monte_carlo(
    tracker: TrackerLike,
    keys: jax.Array,
    frames: Any,
    record: Callable[[Any, Any], Any] = summary_only,
    batch_size: int | None = None,
    devices: Sequence[jax.Device] | None = None,
    frames_per_chunk: int | None = None,
    observed: Any = None,
    inputs: Any = None,
) -> Any:
    """Track one sequence many times, independently.

    Runs are vectorised in blocks.  A run's result depends only on its key: bit for bit between
    blocks of the same width, up to rounding between widths.  On a CPU the width depends on the
    number of runs alone (``blocks_of``), not on devices or chunks.  On an accelerator blocks
    have up to 1024 runs, and half as many if memory runs out: results equal those of a CPU, of
    other numbers of devices and of other memory sizes up to rounding, unless ``batch_size`` fixes
    the width.  ``tracker.observe`` runs once per frame for all runs, on one
    device only.

    Frames are sent to the devices in chunks, which does not change the results.  Memory does not
    grow with T, except for the recorded values.

    On a CPU one device uses little more than one core: call ``jaxpf.use_cores()`` before anything
    is computed to use all.

    Example::

        keys = jax.random.split(jax.random.key(0), 50)
        summaries = jaxpf.monte_carlo(tracker, keys, y)
        jaxpf.log_evidence(summaries).std()  # over 50 runs

    Args:
        tracker: as for ``run``.
        keys: ``[R]`` keys, one per run.
        frames: as for ``run``; or an iterable of single frames, such as a generator, of which two
            chunks are kept at a time.
        record: as for ``run``.
        batch_size: width of all blocks, with the last block padded.  Fixing it makes results
            identical bit for bit for any number of runs on one kind of device.
        devices: devices that share the blocks; default all of ``jax.local_devices()``.
        frames_per_chunk: rounded up to a multiple of the number of devices, at least two per
            device.  Default: as many as fit in ``jaxpf.running.chunks.CHUNK_BYTES``, or all frames
            if they are already on a device.
        observed: as for ``run``.
        inputs: as for ``run``; needs frames in arrays.

    Returns:
        Recorded values with leading axes ``[R, T]``, divided among devices as the keys are.

    Raises:
        InputError: as for ``run``; ``batch_size`` or ``frames_per_chunk`` < 1; frames that differ
            in shape.
    """
    if batch_size is not None:
        check_whole("batch_size", batch_size)
    frames, keys = frames_of(frames), as_key(keys)
    place = keys.sharding if is_concrete(keys) else None
    if isinstance(place, NamedSharding):  # blocks are divided among the devices in their own way
        with jax.ensure_compile_time_eval():
            data = jnp.asarray(np.asarray(jax.random.key_data(keys)))
        keys = jax.random.wrap_key_data(data, impl=jax.random.key_impl(keys))
    count = keys.shape[0]
    blocks = blocks_of(count) if batch_size is None else ((-(-count // batch_size), batch_size),)
    if devices is None and num_idle_cores() and max(count for count, _ in blocks) > 1:
        say_that_cores_are_idle()
    if inputs is not None:
        tracker = with_rows(tracker, inputs, num_frames(frames.stacked()))
    sizes = frames_per_chunk, observed, batch_size
    recorded = run_blocks(tracker, keys, frames, blocks, recognised(record), devices, *sizes)
    kept = frames.whole
    warn_of_frames(recorded, None if kept is None else lambda t: jax.tree.map(lambda x: x[t], kept))
    if isinstance(place, NamedSharding) and is_concrete(recorded):
        recorded = jax.device_put(recorded, place)
    return recorded


def run_blocks(
    tracker: TrackerLike,
    keys: jax.Array,
    frames: Any,
    blocks: Blocks,
    record: Callable[[Any, Any], Any] = summary_only,
    devices: Sequence[jax.Device] | None = None,
    frames_per_chunk: int | None = None,
    observed: Any = None,
    batch_size: int | None = None,
) -> Any:
    """``monte_carlo`` in given blocks, the last of which may be padded.

    Unless ``batch_size`` fixes their width, blocks are halved if an accelerator's memory runs out.
    """
    frames = frames_of(frames)
    if frames.source is None:
        tracker, whole = missing_frames.marked(tracker, frames.whole, observed)
        frames = Frames(whole)
    elif observed is not None:
        rows = frames_of(observed).one_by_one()
        frames = Frames(None, zip(frames.source, rows, strict=True))
    devices = tuple(jax.local_devices() if devices is None else devices)
    may_halve = platform.on_accelerator() and batch_size is None
    if may_halve:
        share = -(-keys.shape[0] // len(devices))
        blocks = even_blocks(keys.shape[0], min(share, _widest(blocks)))
    used = devices[: max(count for count, _ in blocks)]

    kept: list[Any] = []
    length = 0
    for first, count, chunk in in_chunks(frames, frames_per_chunk, len(used)):
        of_chunk = tracker
        if frames.source is not None:
            # Missing frames are known only now.
            chunk, seen = (chunk, None) if observed is None else chunk
            of_chunk, chunk = missing_frames.marked(tracker, chunk, seen, first)
        grouped = in_groups(first, chunk, used)
        if not kept:
            begin = _begin_halving if may_halve and is_concrete(tracker, keys, chunk) else _begin
            with noted(tracker):
                sizes, batches, states, recorded = begin(
                    of_chunk, keys, blocks, grouped, record, used
                )
        else:
            # Compute one chunk while reading the next, without queueing more.
            jax.block_until_ready(kept[-1])
            states, recorded = _advance_compiled(of_chunk, batches, states, *grouped, record, used)
        kept.append(recorded)
        length = first + count

    if len(used) > 1:
        # XLA's queue of computations per device is limited.  Using results before they are ready
        # can fill one device's queue first, and the devices then deadlock (observed: "all gather
        # ... may be stuck").
        jax.block_until_ready(kept)
    return _joined(kept, tuple(sizes), length)


def blocks_of(num_runs: int, asked: int | None = None) -> Blocks:
    """Divide runs into blocks of at most two widths.

    On a CPU this depends only on their number.  With 25 runs or more: blocks of 25, and the rest in
    blocks of 5, the last one padded.  With fewer: blocks of 5 and one block of the rest.

    On an accelerator: as few blocks of one width as possible.

    Args:
        num_runs: number of runs to do.
        asked: total number of runs requested, of which ``num_runs`` remain; default ``num_runs``.
    """
    if platform.on_accelerator():
        return even_blocks(num_runs, _ON_ACCELERATOR)
    if (num_runs if asked is None else asked) < WIDE:
        blocks = (num_runs // NARROW, NARROW), (1, num_runs % NARROW)
    else:
        wide, left = divmod(num_runs, WIDE)
        if left >= _MANY_LEFT:
            wide, left = wide + 1, 0
        blocks = (wide, WIDE), (-(-left // NARROW), NARROW)
    return tuple((count, width) for count, width in blocks if count * width)


def even_blocks(num_runs: int, most: int) -> Blocks:
    """Divide runs into as few blocks of one width, at most ``most``, as possible."""
    count = -(-num_runs // max(1, most))
    return ((count, -(-num_runs // count)),)


def _widest(blocks: Blocks) -> int:
    """Largest width."""
    return max(width for _, width in blocks)


def _begin(
    tracker: TrackerLike, keys: jax.Array, blocks: Blocks, grouped: tuple, record: Any, used: tuple
) -> Any:
    """Advance all runs through the first chunk of frames.

    Returns for each width the number of runs, their keys ``[B, W]``, padded so that every device
    has the same number of blocks, their states and the recorded values.
    """
    sizes, batches, first = [], [], 0
    for count, width in blocks:
        sizes.append(min(count * width, keys.shape[0] - first))
        places = np.arange(-(-count // len(used)) * len(used) * width)
        places = first + np.minimum(places, sizes[-1] - 1)
        batches.append(_taken(keys, places.reshape(-1, width)))
        first += sizes[-1]
    states = _begin_compiled(tracker, batches, used)
    return sizes, batches, *_advance_compiled(tracker, batches, states, *grouped, record, used)


def _begin_halving(
    tracker: TrackerLike, keys: jax.Array, blocks: Blocks, grouped: tuple, record: Any, used: tuple
) -> Any:
    """``_begin`` in blocks that are halved until they fit into the devices' memory."""
    while True:
        try:
            return jax.block_until_ready(_begin(tracker, keys, blocks, grouped, record, used))
        except jax.errors.JaxRuntimeError as error:
            if "RESOURCE_EXHAUSTED" not in str(error) or _widest(blocks) == 1:
                raise
        blocks = even_blocks(keys.shape[0], _widest(blocks) // 2)


# Compiled as a whole: otherwise JAX compiles each operation separately in every process.
@compiled
def _taken(keys: jax.Array, places: np.ndarray) -> jax.Array:
    return keys[places]


@partial(compiled, static_argnames=("sizes", "length"))
def _joined(kept: list[Any], sizes: tuple[int, ...], length: int) -> Any:
    """Join the recorded values of all chunks and widths to ``[R, T, ...]``."""

    def of_width(size: int, *chunks: jax.Array) -> jax.Array:
        whole = chunks[0] if len(chunks) == 1 else jnp.concatenate(chunks, axis=2)
        return whole.reshape(-1, *whole.shape[2:])[:size, :length]

    by_width = [
        jax.tree.map(partial(of_width, size), *chunks)
        for size, chunks in zip(sizes, zip(*kept, strict=True), strict=True)
    ]
    return jax.tree.map(lambda *parts: jnp.concatenate(parts), *by_width)


def in_groups(first: int, frames: Any, devices: tuple) -> tuple[np.ndarray, Any]:
    """Split frames into groups with one frame per device: times ``[G, D]``, frames ``[G, D, ...]``.

    Each of D devices receives only the frames that it observes.
    """
    length, count = num_frames(frames), max(len(devices), 1)
    times = np.arange(first, first + length, dtype=np.int32).reshape(-1, count)
    groups = jax.tree.map(lambda x: x.reshape(-1, count, *x.shape[1:]), frames)
    if count > 1:
        groups = jax.device_put(groups, NamedSharding(_mesh(devices), _OF_GROUPS))
    return times, groups


def begin_batches(tracker: TrackerLike, keys: Sequence[jax.Array], devices: tuple = ()) -> Any:
    """For each width, initial states ``[B, W, ...]`` of runs with keys ``[B, W]``."""

    def begin(tracker, keys):
        return [lax.map(jax.vmap(lambda key: init(tracker, key)), of_width) for of_width in keys]

    if len(devices) > 1:
        begin = _on_devices(begin, devices, (_REPLICATED, _OF_BATCHES))
    return begin(tracker, keys)


def advance_batches(
    tracker: TrackerLike,
    keys: Sequence[jax.Array],
    states: Any,
    times: jax.Array,
    groups: Any,
    record: Callable,
    devices: tuple = (),
) -> tuple[Any, Any]:
    """Advance states ``[B, W, ...]`` through a chunk of frames; compiled by ``monte_carlo``.

    Blocks run in sequence, those of one width in a loop, and are divided among the devices.  In
    each group of frames (see ``in_groups``), every device observes one frame and receives the
    others' observations.  There are keys ``[B, W]`` and states for each width; returned are the
    states after the chunk, and the recorded values ``[B, W, G D, ...]``.
    """
    advance: Callable = partial(
        _advance_on_one_device, record=record, num_devices=max(len(devices), 1)
    )
    if len(devices) > 1:
        places = (_REPLICATED, _OF_BATCHES, _OF_BATCHES, _REPLICATED, _OF_GROUPS)
        advance = _on_devices(advance, devices, places)
    return advance(tracker, keys, states, times, groups)


_begin_compiled = partial(compiled, static_argnames="devices")(begin_batches)
_advance_compiled = partial(compiled, static_argnames=("record", "devices"))(advance_batches)


def _mesh(devices: tuple) -> Mesh:
    return Mesh(np.asarray(devices), (_AXIS,))


def _on_devices(function: Callable, devices: tuple, places: tuple) -> Callable:
    return jax.shard_map(
        function, mesh=_mesh(devices), in_specs=places, out_specs=_OF_BATCHES, check_vma=False
    )


def _advance_on_one_device(tracker, keys, states, times, groups, record, num_devices):
    observe = calls.observed_apart(tracker)[0]

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
        # A group's frames are observed at once; this takes one frame's observation.
        find = partial(calls.frame_of, observe_group(group))
        return lax.scan(
            frame_step(find, of_every_run, record), states, (times, jnp.arange(num_devices))
        )

    states, recorded = lax.scan(group_step, states, (times, groups))

    def by_run(x):
        return jnp.moveaxis(x.reshape(times.size, *x.shape[2:]), 0, 2)

    return states, jax.tree.map(by_run, recorded)
