"""Settings weighed by the evidence that filters give them: no gradient, no truth."""

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
    """Log of the mean estimate of ``p(frames | settings)`` over runs, for each of K trackers.

    All runs share their random numbers.  Trackers of one structure are compiled once.  The
    likelihoods must be the same, or normalised: else the evidence says nothing of the settings.

    Args:
        trackers: K of them, whose summaries have ``log_evidence``.
        key: of the runs.
        frames: ``[T, ...]``.
        num_runs: independent runs of each.

    Returns:
        float64 ``[K]``.
    """
    keys = jax.random.split(key, num_runs)
    found = []
    for tracker in trackers:
        of_frames = monte_carlo(tracker, keys, frames, keep_log_evidence, batch_size=num_runs)
        of_runs = np.sum(np.asarray(of_frames, np.float64), axis=1)
        found.append(logsumexp(of_runs) - np.log(num_runs))
    return np.array(found)
