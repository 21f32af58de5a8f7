"""Dividing an evaluation into batches, and what they cost in time and memory."""

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxpf.errors import InputError
from jaxpf.evaluation.execution import num_cores
from jaxpf.evaluation.plan import Limits, Plan
from jaxpf.evaluation.results import Configuration
from jaxpf.evaluation.trackers import scene_likelihood
from jaxpf.evaluation.worker import Work, scene_digest
from jaxpf.files.versions import versions
from jaxpf.models.likelihoods.histogram import estimated_costs
from jaxpf.running import RUNS_PER_BATCH

#: Seconds that a batch takes about, at most: what a kill can cost.
SECONDS_PER_BATCH = 15.0
#: Bytes of JAX, its libraries and a compiled kernel.
_BASE_MEMORY = 450 * 2**20
#: Nanoseconds of one core per particle, partition and frame, the likelihood excluded.
_KERNEL = 160.0
#: What a core adds to the speed, where there are several.
_SHARE_OF_CORE = 0.75
#: Seconds to compile one kernel.
_COMPILE = 9.0


class Costs(NamedTuple):
    """What the runs of one configuration cost, about.

    Attributes:
        seconds_per_batch: for what a batch of any size needs: the frames' tables.
        seconds_per_run: on top of that.
        bytes_per_run: of memory while a run's batch is computed.
    """

    seconds_per_batch: float
    seconds_per_run: float
    bytes_per_run: int


def check_scene(scene: Any) -> None:
    """Refuse a scene in which trackers cannot start.

    Raises:
        InputError: an object without a box in the first frame; no second frame.
    """
    first = np.asarray(scene.boxes[0], float)
    proper = np.isfinite(first).all(axis=1) & (first[:, 2:] > 0).all(axis=1)
    for index in np.flatnonzero(~proper):
        raise InputError(
            f"scene {scene.name!r}: object {object_ids(scene)[index]} has no box in the start "
            f"frame ({start_frame(scene)}); leave it out with `ids`, or choose another start frame."
        )
    if len(scene.frames) < 2:
        raise InputError(
            f"scene {scene.name!r} has {len(scene.frames)} frame(s): trackers start in the first, "
            "so give at least 2."
        )


def object_ids(scene: Any) -> list[int]:
    """The truth's numbers of the objects; from 1 where a scene has none."""
    return [int(number) for number in scene.extras.get("ids", range(1, scene.boxes.shape[1] + 1))]


def start_frame(scene: Any) -> int:
    """The frame of the source in which a scene begins."""
    return int(scene.extras.get("start_frame", 0))


def new_settings(plan: Plan, scene: Any) -> dict[str, Any]:
    """What ``settings.json`` holds.

    Raises:
        InputError: see ``Plan.configurations``.
    """
    configurations = plan.configurations(
        scene.boxes.shape[1], lambda: _cheaper_likelihood(plan, scene)
    )
    return {
        "versions": versions(),
        "asked": plan.asked(),
        "runs": plan.runs,
        "float64": double_precision(),
        "scene": {
            "name": scene.name,
            "object_ids": object_ids(scene),
            "start_frame": start_frame(scene),
            "fps": float(scene.fps),
            "num_frames": len(scene.frames),
            "width": scene.frames.shape[2],
            "height": scene.frames.shape[1],
            "digest": scene_digest(scene),
        },
        "configurations": [
            {"method": c.method, "ordering": c.ordering, "parameters": c.parameters}
            for c in configurations
        ],
    }


def check_continues(settings: dict[str, Any], scene: Any, folder: Any) -> None:
    """Refuse to mix results of different pictures or precisions.

    Raises:
        InputError: the scene or the precision is not that of the finished batches.
    """
    if scene_digest(scene) != settings["scene"]["digest"]:
        raise InputError(
            f"scene {scene.name!r} has other pictures or boxes than when the evaluation in "
            f"'{folder}' was begun; choose another output folder, or restore the scene."
        )
    if double_precision() != settings["float64"]:
        begun, now = ("double", "single") if settings["float64"] else ("single", "double")
        raise InputError(
            f"the evaluation in '{folder}' was begun in {begun} precision, now {now}; choose "
            "another output folder, or set JAX_ENABLE_X64 as it was."
        )


def double_precision() -> bool:
    """Whether JAX computes in double precision."""
    return jnp.zeros(()).dtype == jnp.float64


def batches(
    plan: Plan,
    scene: Any,
    digest: str,
    configurations: list[Configuration],
    done: list[np.ndarray],
    limits: Limits,
) -> tuple[list[Work], float, int]:
    """Divide what is missing into batches.

    Returns:
        The batches, about how many seconds they take on this machine, compiling included, and
        about how many bytes a process takes.
    """
    ours = [index for index, c in enumerate(configurations) if not c.is_imported]
    missing = sum(int(np.sum(~done[index])) for index in ours)
    share = max(1, math.ceil(missing / limits.workers))
    unit = RUNS_PER_BATCH * (limits.devices or jax.local_device_count())
    known: dict[tuple, Costs] = {}
    shapes = set()
    work, seconds, largest = [], 0.0, 0
    for index in ours:
        configuration = configurations[index]
        shape = _shape_of(configuration)
        if shape not in known:
            known[shape] = costs(configuration, scene)
        cost = known[shape]
        most = limits.runs_per_batch or most_runs(cost, limits.memory, unit)
        for first, count, width in divide(done[index], min(most, share)):
            work.append(
                Work(
                    index=index,
                    configuration=configuration,
                    first_run=first,
                    num_runs=count,
                    width=width,
                    seed=plan.seed,
                    float64=double_precision(),
                    scene=plan.scene,
                    digest=digest,
                )
            )
            seconds += cost.seconds_per_batch + width * cost.seconds_per_run
            largest = max(largest, width * cost.bytes_per_run)
            shapes.add((shape, width))
    # Two copies of the frames: the scene's, and the device's.
    memory = _BASE_MEMORY + 2 * scene.frames.nbytes + largest
    return work, seconds + _COMPILE * len(shapes), memory


def costs(configuration: Configuration, scene: Any) -> Costs:
    """What the runs of a configuration cost."""
    parameters: dict[str, Any] = configuration.parameters
    num_frames, num_objects = len(scene.frames) - 1, scene.boxes.shape[1]
    num_particles, method = parameters["particles"], parameters["likelihood"]
    model = scene_likelihood(
        scene,
        sharpness=parameters["sharpness"],
        num_particles=num_particles,
        parts=parameters["parts"],
        likelihood=method,
    )

    def per_frame(runs: int) -> float:
        return estimated_costs(
            num_pixels=math.prod(scene.frames.shape[1:3]),
            num_bins=model.references.shape[-1],
            num_parts=parameters["parts"],
            num_objects=num_objects,
            num_particles=num_particles,
            num_runs=runs,
        )[method]

    fixed = per_frame(0)
    seconds = 1e-9 * num_frames / max(1.0, _SHARE_OF_CORE * num_cores())
    kernel = _KERNEL * num_objects * num_particles
    item = jnp.zeros(()).dtype.itemsize
    state = item * num_particles * (num_objects * 7 + 2)
    recorded = 4 * num_frames * (num_objects * 8 + 2)
    return Costs(
        seconds_per_batch=fixed * seconds,
        seconds_per_run=(per_frame(1) - fixed + kernel) * seconds,
        bytes_per_run=3 * state + 4 * recorded,
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


def _shape_of(configuration: Configuration) -> tuple[Any, ...]:
    """The parameters that a kernel is compiled for."""
    names = ("particles", "parts", "resampling", "likelihood")
    return tuple(configuration.parameters[name] for name in names)


def _cheaper_likelihood(plan: Plan, scene: Any) -> str:
    """What "auto" stands for, whatever the number of runs: it decides about the results."""
    return scene_likelihood(
        scene,
        sharpness=plan.sharpness[0],
        num_particles=max(plan.particles),
        parts=plan.parts[0],
        likelihood="auto",
    ).method
