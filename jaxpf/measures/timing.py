"""Comparable timings on a shared machine: candidates are timed in turn and compared by ratio."""

import time
from collections.abc import Callable, Mapping

import jax
import numpy as np


def interleaved(
    candidates: Mapping[str, Callable[[], object]],
    repeats: int,
    clock: Callable[[], float] = time.perf_counter,
) -> dict[str, np.ndarray]:
    """Seconds ``[repeats]`` of each candidate, timed in turn after one warm-up."""
    for candidate in candidates.values():
        jax.block_until_ready(candidate())
    seconds: dict[str, list[float]] = {name: [] for name in candidates}
    for repeat in range(repeats):
        names = list(candidates)
        for name in names if repeat % 2 == 0 else reversed(names):
            began = clock()
            jax.block_until_ready(candidates[name]())
            seconds[name].append(clock() - began)
    return {name: np.array(values) for name, values in seconds.items()}
