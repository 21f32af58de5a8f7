"""Dividing an evaluation into batches, and what they cost in time and memory."""

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxpf import filters
from jaxpf.chunks import chunk_length
from jaxpf.evaluation.execution import num_cores
from jaxpf.evaluation.plan import Limits, Plan
from jaxpf.evaluation.results import BUILT_IN, Configuration
from jaxpf.evaluation.trackers import tracker_of
from jaxpf.evaluation.worker import Work
from jaxpf.options import options_of
from jaxpf.running import RUNS_PER_BATCH
from jaxpf.targets.target import Target

#: Seconds that a batch takes about, at most: what a kill can cost.
SECONDS_PER_BATCH = 15.0
#: Of the memory of a batch, what a chunk of frames may take.
_SHARE_OF_FRAMES = 1 / 4
#: Chunks in memory at once: one that is computed, here and on the devices, and one that is read.
_CHUNKS = 3
#: Bytes of JAX, its libraries and the compiling of a kernel, measured.
_BASE_MEMORY = 800 * 2**20
#: What a core adds to the speed, where there are several.
_SHARE_OF_CORE = 0.75
#: Seconds to decode a pixel of a long recording, which every batch reads anew.
_READ = 5e-9
#: Seconds to compile one kernel.
_COMPILE = 9.0


class Costs(NamedTuple):
    """What the runs of one configuration cost, about.

    Attributes:
        seconds_per_batch: for what a batch of any size needs: the frames' tables.
        seconds_per_run: on top of that.
        bytes_per_run: of memory while a run's batch is computed.
        bytes_per_frame: of what is kept of a frame while runs are moved on to it.
    """

    seconds_per_batch: float
    seconds_per_run: float
    bytes_per_run: int
    bytes_per_frame: int


def batches(
    plan: Plan,
    scene: Any,
    target: Target,
    digest: str,
    configurations: list[Configuration],
    done: list[np.ndarray],
    limits: Limits,
) -> tuple[list[Work], float, int]:
    """Divide what is missing into batches.

    Returns:
        The batches, about how many seconds they take on this machine, compiling included, and
        about how many bytes a process takes.  What a user wrote is not modelled: it goes batch by
        smallest batch, and the progress tells its time.
    """
    ours = [index for index, c in enumerate(configurations) if not c.is_imported]
    missing = sum(int(np.sum(~done[index])) for index in ours)
    share = max(1, math.ceil(missing / limits.workers))
    devices = limits.devices or jax.local_device_count()
    unit = RUNS_PER_BATCH * devices
    known: dict[Any, Costs | None] = {}
    shapes = set()
    work, seconds, largest = [], 0.0, 0
    one = math.prod(scene.frames.shape[1:])
    length = chunk_length(len(scene.frames) - 1, one, int(_SHARE_OF_FRAMES * limits.memory))
    for index in ours:
        configuration = configurations[index]
        if done[index].all():
            continue
        shape = shape_of(configuration, target)
        function = plan.trackers.get(configuration.method)
        if shape not in known:
            known[shape] = costs(configuration, scene, target)
        cost = known[shape]
        most = limits.runs_per_batch or (most_runs(cost, limits.memory, unit) if cost else unit)
        for first, count, width in divide(done[index], min(most, share)):
            work.append(
                Work(
                    index=index,
                    configuration=configuration,
                    first_run=first,
                    num_runs=count,
                    width=width,
                    frames_per_chunk=length,
                    seed=plan.seed,
                    float64=double_precision(),
                    scene=plan.scene,
                    digest=digest,
                    target=target.name,
                    function=function,
                )
            )
            shapes.add((shape, width))
            if cost:
                seconds += cost.seconds_per_batch + width * cost.seconds_per_run
                # Of a group of frames every device has what all devices made of theirs.
                shared = devices * min(devices, math.ceil(width / RUNS_PER_BATCH))
                takes = width * cost.bytes_per_run + shared * cost.bytes_per_frame
                largest = max(largest, takes)
    kept = scene.frames.nbytes
    if not isinstance(scene.frames, np.ndarray):
        seconds += len(work) * _READ * kept / 3
        kept = 0
    memory = _BASE_MEMORY + kept + _CHUNKS * length * one + largest
    return work, seconds + _COMPILE * len(shapes), memory


def double_precision() -> bool:
    """Whether JAX computes in double precision."""
    return jnp.zeros(()).dtype == jnp.float64


def costs(configuration: Configuration, scene: Any, target: Target) -> Costs | None:
    """What the runs of a configuration cost; None where nobody knows: of a user's tracker."""
    if configuration.kind != BUILT_IN:
        return None
    tracker = tracker_of(scene, target, configuration)
    estimate = getattr(tracker.likelihood, "estimated_nanoseconds", None)
    if estimate is None:
        return None
    num_frames = len(scene.frames) - 1
    size = _bytes(jax.eval_shape(tracker.init, jax.random.key(0)))
    frame = jax.ShapeDtypeStruct(scene.frames.shape[1:], scene.frames.dtype)
    bytes_per_frame = _bytes(jax.eval_shape(tracker.observe, frame))
    recorded = 4 * num_frames * (tracker.num_partitions * 8 + 2)
    bytes_per_run = 3 * size + 4 * recorded
    queries = tracker.num_partitions * configuration.parameters["particles"]
    fixed, per_query = estimate(scene.frames.shape[1:3])
    kernel = filters.filter_of(configuration.variant["method"]).nanoseconds
    seconds = 1e-9 * num_frames / max(1.0, _SHARE_OF_CORE * num_cores())
    return Costs(
        fixed * seconds, (per_query + kernel) * queries * seconds, bytes_per_run, bytes_per_frame
    )


def most_runs(cost: Costs, memory: int, unit: int) -> int:
    """Runs that one batch may hold, by its memory and by what a kill would cost."""
    by_memory = memory / cost.bytes_per_run
    by_time = SECONDS_PER_BATCH / cost.seconds_per_run
    return max(1, int(min(by_memory, by_time)) // unit) * unit


def divide(done: np.ndarray, largest: int) -> Iterator[tuple[int, int, int]]:
    """Divide the missing runs into batches of nearly equal size.

    Args:
        done: ``[R]`` bool.
        largest: runs that a batch may hold.

    Yields:
        First run, number of runs, and runs to compute: the same for all batches of one gap.
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[True], done, [True]]).astype(np.int8)))
    for start, stop in edges.reshape(-1, 2).tolist():
        count = math.ceil((stop - start) / largest)
        width = math.ceil((stop - start) / count / RUNS_PER_BATCH) * RUNS_PER_BATCH
        for first in range(start, stop, width):
            yield first, min(width, stop - first), width


def _bytes(tree: Any) -> int:
    """Of the arrays of a tree of shapes."""
    arrays = [leaf for leaf in jax.tree.leaves(tree) if hasattr(leaf, "shape")]
    return sum(math.prod(x.shape) * np.dtype(x.dtype).itemsize for x in arrays)


def shape_of(configuration: Configuration, target: Target) -> tuple[Any, ...]:
    """What a kernel is compiled for."""
    if configuration.kind != BUILT_IN:
        return (configuration.method,)
    its = filters.filter_of(configuration.variant["method"])
    options = options_of(target.options, its.options)
    names = [name for name, option in options.items() if option.compiles and name not in its.varied]
    return (its.name, *(configuration.parameters[name] for name in names))
