"""Measures of the runs of a variant on S scenes: R runs of T frames, L targets."""

from collections.abc import Mapping

import numpy as np

#: Range of the mean number of samples per target over runs in per cent, figure 2 (b).
SHARE_BAND = (49.5, 50.5)
#: A larger error relative to the target's size counts as a lost target: the published errors are
#: all below .14 or above 2.4.
LOST = 1.0


def measures(runs: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Measure -> ``[S]``, of the arrays that ``scenes.measure`` returns for a variant."""
    error, ratio, share = runs["error"], runs["area_ratio"], runs["share"]
    # The first target's share of the particles, mean over frames.
    shares = 100 * share[..., 0].mean(axis=-1)
    return {
        "share": shares.mean(axis=1),
        "in band": np.mean((SHARE_BAND[0] <= shares) & (shares <= SHARE_BAND[1]), axis=1),
        "starved": (share[:, :, -1] == 0).any(axis=-1).mean(axis=1),
        "error": tracked_error(error),
        "error at a strip": _mean_where(runs["in_strip"], error),
        "error elsewhere": _mean_where(~runs["in_strip"], error),
        "lost": lost(error).mean(axis=1),
        "samples lost": 100 * runs["astray"].mean(axis=(1, 2)),
        "side": last_side(ratio),
        "between": 100 * runs["between"],
        "within": 100 * runs["within"],
    }


def lost(error: np.ndarray) -> np.ndarray:
    """``[S, R L]`` bool: targets whose mean error ``[S, R, T, L]`` is above ``LOST``."""
    return (error.mean(axis=2) > LOST).reshape(len(error), -1)


def tracked_error(error: np.ndarray) -> np.ndarray:
    """``[S]``: mean error of a scene's targets that were not lost; NaN if all were lost."""
    mean = error.mean(axis=2).reshape(len(error), -1)
    kept = ~lost(error)
    total = np.where(kept, mean, 0.0).sum(axis=1)
    return np.where(kept.any(axis=1), total / np.maximum(kept.sum(axis=1), 1), np.nan)


def last_side(ratio: np.ndarray) -> np.ndarray:
    """``[S]``: root of estimated over true area in the last tenth of the frames, lost or not.

    Geometric mean over runs, targets and frames.
    """
    late = ratio[:, :, -max(ratio.shape[2] // 10, 1) :]
    return np.exp(np.log(np.maximum(late, 1e-6)).mean(axis=(1, 2, 3)) / 2)


def _mean_where(counts: np.ndarray, error: np.ndarray) -> np.ndarray:
    """``[S]``: mean error over the frames that count, ``[S, T, L]`` bool."""
    counts = np.broadcast_to(counts[:, None], error.shape)
    total, number = np.where(counts, error, 0.0).sum(axis=(1, 2, 3)), counts.sum(axis=(1, 2, 3))
    return np.where(number > 0, total / np.maximum(number, 1), np.nan)
