"""Settings compared by the evidence that filters give them: no gradient, no truth."""

from collections.abc import Sequence
from typing import Any

import jax
import numpy as np
from scipy.special import logsumexp

from jaxpf.running.blocks import monte_carlo
from jaxpf.tuning.objectives import keep_log_evidence


def log_evidences(
    trackers: Sequence[Any], key: jax.Array, frames: Any, num_runs: int = 4
) -> np.ndarray:
    """Log of the mean estimate of ``p(frames | settings)`` over runs, float64 ``[K]``.

    All runs share their random numbers.  Trackers of one structure are compiled once.  Their
    likelihoods must be the same, or normalised: otherwise evidences are not comparable.

    Args:
        trackers: K of them, whose summaries have ``log_evidence``.
        key: a random key.
        frames: ``[T, ...]``.
        num_runs: independent runs of each.
    """
    keys = jax.random.split(key, num_runs)
    logs = []
    for tracker in trackers:
        of_frames = monte_carlo(tracker, keys, frames, keep_log_evidence, batch_size=num_runs)
        of_runs = np.sum(np.asarray(of_frames, np.float64), axis=1)
        logs.append(logsumexp(of_runs) - np.log(num_runs))
    return np.array(logs)
