"""The machine: its cores, and whether work fits in its memory, checked before starting."""

import contextlib
import functools
import math
import os
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from jaxpf.contract.errors import InputError
from jaxpf.contract.numbers import check_whole
from jaxpf.contract.optional import likelihood_of
from jaxpf.lowering import platform

if TYPE_CHECKING:
    import jax

    from jaxpf.contract.types import TrackerLike

#: Memory of JAX, its libraries and a compiled kernel, bytes.
_BASE = 450 * 2**20
#: Memory of a step relative to the size of the state, for histograms from tables and from samples.
#: Measured with two objects and a million particles.
_FROM_TABLES, _FROM_SAMPLES = 6, 18
#: Linux files that hold a container's memory limit.
_CONTAINER = ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes")


def check_memory(needed: float, remedy: str) -> None:
    """Refuse work that does not fit into this machine's memory.

    Args:
        needed: approximate size, bytes.
        remedy: what the user can do instead, for the message.

    Raises:
        InputError: names both sizes.
    """
    limit = machine_memory()
    if limit is not None and needed > limit:
        raise InputError(
            f"this takes about {_gigabytes(needed)} GB of memory, and this machine has "
            f"{_gigabytes(limit)} GB; {remedy}."
        )


def needed_by(tracker: "TrackerLike", runs: int = 1, kept_frames: int = 1) -> float:
    """Estimate the memory that a tracker needs, in bytes.

    Args:
        tracker: any tracker.
        runs: number of runs computed together.
        kept_frames: number of frames whose states are kept for a derivative.
    """
    import jax

    state = jax.eval_shape(tracker.init, jax.random.key(0))
    leaves = [leaf for leaf in jax.tree.leaves(state) if hasattr(leaf, "shape")]
    size = sum(math.prod(leaf.shape) * np.dtype(leaf.dtype).itemsize for leaf in leaves)
    method = getattr(likelihood_of(tracker), "method", None)
    step = _FROM_SAMPLES if method == "sampled" else _FROM_TABLES
    return _BASE + runs * size * (step + kept_frames)


def num_cores() -> int:
    """Number of processor cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def use_cores(cores: int | None = None) -> int:
    """Let ``monte_carlo`` use several cores of a CPU; by default all that this process may use.

    One device of JAX uses little more than one core, so each core becomes a device.  Call it before
    the first computation; on a machine with a GPU it changes nothing there.

    Example::

        jaxpf.use_cores()  # first of all
        summaries = jaxpf.monte_carlo(tracker, keys, y)

    Args:
        cores: number of cores.

    Returns:
        The number of cores.

    Raises:
        InputError: JAX has already started, with another number.
    """
    import jax

    cores = num_cores() if cores is None else cores
    check_whole("cores", cores)
    try:
        jax.config.update("jax_num_cpu_devices", cores)
    except RuntimeError:
        started = len(jax.devices("cpu"))
        if started != cores:
            raise InputError(
                f"JAX has already started with {started} of {cores} cores; call jaxpf.use_cores() "
                "first, before anything is computed."
            ) from None
    return cores


def num_idle_cores() -> int:
    """Number of cores that JAX leaves unused because it has a single CPU device."""
    import jax

    single = jax.local_device_count() == 1 and not platform.on_accelerator()
    return num_cores() - 1 if single else 0


@functools.cache
def say_that_cores_are_idle() -> None:
    """Warn once of cores that a single CPU device leaves unused."""
    warnings.warn(
        f"runs use one of {num_cores()} cores; to use all, call jaxpf.use_cores() before anything "
        "is computed.  Passing devices=jax.devices() silences this warning.",
        stacklevel=3,
    )


def machine_memory() -> int | None:
    """Memory of this machine or container, in bytes; None if unknown."""
    limits = []
    with contextlib.suppress(AttributeError, ValueError, OSError):
        limits.append(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    for path in _CONTAINER:
        with contextlib.suppress(OSError, ValueError):  # the file may hold "max"
            limits.append(int(Path(path).read_text()))
    with contextlib.suppress(ImportError, OSError, ValueError):
        import resource

        soft, _ = resource.getrlimit(resource.RLIMIT_AS)
        if soft != resource.RLIM_INFINITY:
            limits.append(soft)
    return min(limits, default=None)


def device_memory(devices: "Sequence[jax.Device]") -> float:
    """Free memory of the fullest device, in bytes; infinite if unknown, as on a CPU."""
    known = [stats for device in devices if (stats := device.memory_stats())]
    free = [x["bytes_limit"] - x.get("bytes_in_use", 0) for x in known if "bytes_limit" in x]
    return min(free, default=math.inf)


def _gigabytes(size: float) -> str:
    return f"{size / 2**30:.1f}"
