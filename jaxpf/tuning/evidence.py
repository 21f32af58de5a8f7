"""Compare settings by their estimated evidence; needs neither gradients nor ground truth."""

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
    """Log of the mean over runs of the estimates of ``p(frames | settings)``, float64 ``[K]``.

    All runs share their random numbers.  Trackers of equal structure are compiled once.  Evidences
    are comparable only if the likelihoods are the same or normalised.

    Args:
        trackers: K trackers whose summaries have ``log_evidence``.
        key: random key.
        frames: ``[T, ...]``.
        num_runs: independent runs per tracker.
    """
    keys = jax.random.split(key, num_runs)
    logs = []
    for tracker in trackers:
        of_frames = monte_carlo(tracker, keys, frames, keep_log_evidence, batch_size=num_runs)
        of_runs = np.sum(np.asarray(of_frames, np.float64), axis=1)
        logs.append(logsumexp(of_runs) - np.log(num_runs))
    return np.array(logs)
