"""Check available memory before anything is computed."""

import contextlib
import math
import os
from pathlib import Path
from typing import Any

import numpy as np

from jaxpf.contract.errors import InputError

#: Bytes of JAX, its libraries and a compiled kernel.
_BASE = 450 * 2**20
#: Memory of a step over the size of the state: measured, with two objects and a million particles,
#: for histograms from tables and for those from samples.
_FROM_TABLES, _FROM_SAMPLES = 6, 18
#: Where Linux keeps a container's limit.
_CONTAINER = ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes")


def check_memory(needed: float, remedy: str) -> None:
    """Refuse what does not fit into the memory of this machine.

    Args:
        needed: bytes, about.
        remedy: what the user can do instead.

    Raises:
        InputError: names both sizes.
    """
    limit = machine_memory()
    if limit is not None and needed > limit:
        raise InputError(
            f"this takes about {_gigabytes(needed)} GB of memory, and this machine has "
            f"{_gigabytes(limit)} GB; {remedy}."
        )


def needed_by(tracker: Any, runs: int = 1, kept_frames: int = 1) -> float:
    """About how many bytes a tracker takes.

    Args:
        tracker: one of ours, or a user's.
        runs: that are computed together.
        kept_frames: whose states are kept for a derivative.
    """
    import jax

    state = jax.eval_shape(tracker.init, jax.random.key(0))
    leaves = [leaf for leaf in jax.tree.leaves(state) if hasattr(leaf, "shape")]
    size = sum(math.prod(leaf.shape) * np.dtype(leaf.dtype).itemsize for leaf in leaves)
    likelihood = getattr(getattr(tracker, "tracker", tracker), "likelihood", None)
    method = getattr(getattr(likelihood, "likelihood", likelihood), "method", None)
    step = _FROM_SAMPLES if method == "sampled" else _FROM_TABLES
    return _BASE + runs * size * (step + kept_frames)


def machine_memory() -> int | None:
    """Bytes that this machine, or this container, has; None if unknown."""
    found = []
    with contextlib.suppress(AttributeError, ValueError, OSError):
        found.append(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    for path in _CONTAINER:
        with contextlib.suppress(OSError, ValueError):  # "max" is no number
            found.append(int(Path(path).read_text()))
    with contextlib.suppress(ImportError, OSError, ValueError):
        import resource

        soft, _ = resource.getrlimit(resource.RLIMIT_AS)
        if soft != resource.RLIM_INFINITY:
            found.append(soft)
    return min(found, default=None)


def _gigabytes(size: float) -> str:
    return f"{size / 2**30:.1f}"
