"""Measures of the experiment, by the names in ``claims.csv``."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from jaxpf.papers.judging.measures import Measure
from jaxpf.papers.rowe2005 import published
from jaxpf.papers.rowe2005.scenes import Measurement, Outcome


def run_share(outcome: Outcome, variant: str) -> np.ndarray:
    """``[S, R]``: the first target's share of the particles, mean over frames, per cent."""
    return 100 * outcome.share[outcome.of(variant), ..., 0].mean(axis=-1)


def starved(outcome: Outcome, variant: str) -> np.ndarray:
    """``[S, R]`` bool: some target has no particles in the last frame."""
    return (outcome.share[outcome.of(variant), :, :, -1] == 0).any(axis=-1)


def lost(outcome: Outcome, variant: str) -> np.ndarray:
    """``[S, R L]`` bool: targets whose mean error is above ``published.LOST``."""
    error = outcome.error[outcome.of(variant)].mean(axis=2)
    return (error > published.LOST).reshape(len(error), -1)


def tracked_error(outcome: Outcome, variant: str) -> np.ndarray:
    """``[S]``: mean error of a scene's targets that were not lost; NaN if all were lost."""
    error = outcome.error[outcome.of(variant)].mean(axis=2).reshape(len(outcome.in_strip), -1)
    kept = error <= published.LOST
    total = np.where(kept, error, 0.0).sum(axis=1)
    return np.where(kept.any(axis=1), total / np.maximum(kept.sum(axis=1), 1), np.nan)


def astray(outcome: Outcome, variant: str) -> np.ndarray:
    """``[S]``: percentage of particles whose box misses their target's true box."""
    return 100 * outcome.astray[outcome.of(variant)].mean(axis=(1, 2))


def error_by_place(outcome: Outcome, variant: str, strip: bool) -> np.ndarray:
    """``[S]``: mean error over frames whose true box overlaps a strip, or over the others."""
    counts = (outcome.in_strip == strip)[:, None]
    error = outcome.error[outcome.of(variant)]
    total = np.where(counts, error, 0.0).sum(axis=(1, 2, 3))
    number = np.broadcast_to(counts, error.shape).sum(axis=(1, 2, 3))
    return np.where(number > 0, total / np.maximum(number, 1), np.nan)


def last_ratio(outcome: Outcome, variant: str) -> np.ndarray:
    """``[S]``: root of estimated over true area in the last tenth of the frames, lost or not.

    Geometric mean over runs, targets and frames.
    """
    ratio = outcome.area_ratio[outcome.of(variant)]
    late = ratio[:, :, -max(ratio.shape[2] // 10, 1) :]
    return np.exp(np.log(np.maximum(late, 1e-6)).mean(axis=(1, 2, 3)) / 2)


def _in_band(outcome: Outcome, variant: str) -> np.ndarray:
    low, high = published.SHARE_BAND
    shares = run_share(outcome, variant)
    return (low <= shares) & (shares <= high)


def _of(measure: Callable[..., Any], runs: str = "outcome", **options: Any) -> Callable[..., Any]:
    """The measure as a function of the whole measurement and the variant."""

    def values(measured: Measurement, variant: str) -> np.ndarray:
        return measure(getattr(measured, runs), variant, **options)

    return values


def _between(outcome: Outcome, variant: str) -> np.ndarray:
    return 100 * outcome.between[outcome.of(variant)]


def _within(outcome: Outcome, variant: str) -> np.ndarray:
    return 100 * outcome.within[outcome.of(variant)]


def _between_over_within(outcome: Outcome, variant: str) -> np.ndarray:
    return _between(outcome, variant) / _within(outcome, variant)


MEASURES: Mapping[str, Measure] = {
    "share": Measure(_of(lambda *args: run_share(*args).mean(axis=1)), digits=2),
    "in band": Measure(_of(_in_band), "percent"),
    "starved": Measure(_of(starved), "percent"),
    "error": Measure(_of(tracked_error), digits=3),
    "error at a strip": Measure(_of(error_by_place, strip=True), digits=3),
    "error elsewhere": Measure(_of(error_by_place, strip=False), digits=3),
    "lost": Measure(_of(lost), "percent"),
    "lost where crossing": Measure(_of(lost, "crossing"), "percent"),
    "samples lost": Measure(_of(astray), digits=1),
    "side": Measure(_of(last_ratio), digits=2),
    "between": Measure(_of(_between), "ratio", digits=1),
    "within": Measure(_of(_within), digits=1),
    "between over within": Measure(_of(_between_over_within), "ratio"),
}
