"""Divides an evaluation into batches by the memory and the work of their runs."""

import math
from collections.abc import Hashable, Iterator
from typing import TYPE_CHECKING, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxpf import filters
from jaxpf.contract.options import options_of
from jaxpf.evaluation.plan import Limits, Plan
from jaxpf.evaluation.results import BUILT_IN, Configuration
from jaxpf.evaluation.trackers import tracker_of
from jaxpf.evaluation.worker import Work
from jaxpf.lowering import platform
from jaxpf.running.chunks import chunk_length
from jaxpf.running.widths import WIDE, Blocks, blocks_of
from jaxpf.targets.target import Target

if TYPE_CHECKING:
    from scenes import Scene

#: Largest number of likelihoods per batch and core, which an interrupted process can lose: about 15
#: seconds of colour histograms.
_MOST_QUERIES = 5e7
#: How many times as many in the same time on an accelerator.
_ACCELERATION = 100
#: Share of a batch's memory that a chunk of frames may use.
_SHARE_OF_FRAMES = 1 / 4
#: Chunks in memory at once: the current one on host and devices, and the one being read.
_CHUNKS = 3
#: Measured bytes for JAX, its libraries and the compilation of a kernel.
_BASE_MEMORY = 800 * 2**20


class Costs(NamedTuple):
    """Work and memory of the runs of one configuration.

    Attributes:
        queries_per_run: likelihoods that a run computes.
        bytes_per_run: memory while the run's batch is computed.
        bytes_per_frame: memory for the tables of one frame.
    """

    queries_per_run: int
    bytes_per_run: int
    bytes_per_frame: int


def batches(
    plan: Plan,
    scene: "Scene",
    target: Target,
    digest: str,
    configurations: list[Configuration],
    done: list[np.ndarray],
    limits: Limits,
) -> tuple[list[Work], int]:
    """Divide the missing runs into batches.

    Returns:
        The batches, and the estimated bytes per process.  User-defined trackers are not counted
        and use the smallest batches.
    """
    ours = [index for index, c in enumerate(configurations) if not c.is_imported]
    missing = sum(int(np.sum(~done[index])) for index in ours)
    share = max(1, math.ceil(missing / limits.workers))
    devices = limits.devices or jax.local_device_count()
    cost_by_shape: dict[tuple[Hashable, ...], Costs | None] = {}
    work, largest = [], 0
    frame_bytes = math.prod(scene.frames.shape[1:])
    length = chunk_length(len(scene.frames) - 1, frame_bytes, int(_SHARE_OF_FRAMES * limits.memory))
    for index in ours:
        configuration = configurations[index]
        if done[index].all():
            continue
        shape = shape_of(configuration, target)
        function = plan.trackers.get(configuration.method)
        if shape not in cost_by_shape:
            cost_by_shape[shape] = costs(configuration, scene, target)
        cost = cost_by_shape[shape]
        most = limits.runs_per_batch or WIDE * devices
        if cost and not limits.runs_per_batch:
            most = most_runs(cost, limits.memory, devices)
        for first, count, blocks in divide(done[index], min(most, share)):
            work.append(
                Work(
                    index=index,
                    configuration=configuration,
                    first_run=first,
                    num_runs=count,
                    blocks=blocks,
                    frames_per_chunk=length,
                    seed=plan.seed,
                    float64=double_precision(),
                    scene=plan.scene,
                    digest=digest,
                    target=target.name,
                    function=function,
                )
            )
            if cost:
                # Each device holds the tables of a group of frames, one frame from every device.
                used = min(devices, max(number for number, _ in blocks))
                kept = work[-1].width * cost.bytes_per_run + devices * used * cost.bytes_per_frame
                largest = max(largest, kept)
    kept = scene.frames.nbytes if isinstance(scene.frames, np.ndarray) else 0
    return work, _BASE_MEMORY + kept + _CHUNKS * length * frame_bytes + largest


def double_precision() -> bool:
    """Whether JAX computes in double precision."""
    return jnp.zeros(()).dtype == jnp.float64


def costs(configuration: Configuration, scene: "Scene", target: Target) -> Costs | None:
    """Estimate the cost of a configuration's runs; None for user-defined trackers."""
    if configuration.kind != BUILT_IN:
        return None
    tracker = tracker_of(scene, target, configuration)
    num_frames = len(scene.frames) - 1
    size = _bytes(jax.eval_shape(tracker.init, jax.random.key(0)))
    frame = jax.ShapeDtypeStruct(scene.frames.shape[1:], scene.frames.dtype)
    bytes_per_frame = _bytes(jax.eval_shape(tracker.observe, frame))
    recorded = 4 * num_frames * (tracker.num_partitions * 8 + 2)
    queries = num_frames * tracker.num_partitions * tracker.num_particles
    return Costs(queries, 3 * size + 4 * recorded, bytes_per_frame)


def most_runs(cost: Costs, memory: int, devices: int) -> int:
    """Largest number of runs per batch, limited by memory and by the work lost if interrupted."""
    faster = _ACCELERATION if platform.on_accelerator() else 1
    by_work = devices * faster * _MOST_QUERIES / cost.queries_per_run
    unit = WIDE * devices
    return max(1, int(min(memory / cost.bytes_per_run, by_work)) // unit) * unit


def divide(done: np.ndarray, largest: int) -> Iterator[tuple[int, int, Blocks]]:
    """Divide the missing runs into batches of whole blocks, nearly equal in size.

    Blocks are counted from the first run of a gap.  A run's block thus has the same width however
    the gap is divided and whichever batches survive an interruption; not so on an accelerator,
    where a batch is one block.

    Args:
        done: ``[R]`` bool, whether each run is finished.
        largest: limit on runs per batch; a batch has at least one block.

    Yields:
        First run, number of runs, and blocks to compute.
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[True], done, [True]]).astype(np.int8)))
    for start, stop in edges.reshape(-1, 2).tolist():
        blocks = blocks_of(stop - start, len(done), largest)
        if stop - start <= largest:
            yield start, stop - start, blocks
            continue
        for count, width in blocks:
            batches = math.ceil(count / max(1, largest // width))
            each = math.ceil(count / batches)
            end = min(stop, start + count * width)
            for first in range(start, end, each * width):
                yield first, min(each * width, end - first), ((each, width),)
            start = end


def _bytes(tree: object) -> int:
    """Total bytes of the arrays in a pytree of shapes."""
    arrays = [leaf for leaf in jax.tree.leaves(tree) if hasattr(leaf, "shape")]
    return sum(math.prod(x.shape) * np.dtype(x.dtype).itemsize for x in arrays)


def shape_of(configuration: Configuration, target: Target) -> tuple[Hashable, ...]:
    """Values on which the compiled kernel depends; equal ones share a kernel."""
    if configuration.kind != BUILT_IN:
        return (configuration.method,)
    filter_ = filters.filter_of(configuration.variant["method"])
    options = options_of(target.tracker, filter_.build)
    names = [
        name for name, option in options.items() if option.compiles and name not in filter_.varied
    ]
    return (filter_.name, *(configuration.parameters[name] for name in names))
