"""Rates, means and paired differences over the runs of an evaluation, with their uncertainty.

Runs are the independent units.  Frames and objects of one run are correlated, so they contribute
to the value but do not narrow the interval.

* A rate of one object has Wilson's interval.  The rate over all objects is the mean of their
  rates.  Its interval is Wilson's at the effective number of trials p (1 - p) / SE^2, with SE the
  standard error over runs (Korn and Graubard 1998; Dean and Pagano 2015), clipped between the
  number of runs and the number of runs times objects.  If every object always succeeds or always
  fails, the number of trials is the number of runs.
* A mean pools the frames that count; ``intervals.mean_interval`` gives its error over runs.
  The mean of a share has Wilson's interval at the effective number of trials.
* A difference compares runs with equal seeds, which share their random numbers.  A difference of
  rates has Newcombe's hybrid score interval (1998, Statistics in Medicine 17:2635, method 10)
  and McNemar's exact test; a difference of means has the standard error of the runs' differences,
  with Student's interval and test.
"""

import math
from typing import NamedTuple

import jax
import numpy as np
from numpy.typing import ArrayLike
from scipy.special import bdtr, stdtr, stdtrit

from jaxpf.measures.intervals import (
    Interval,
    mean_interval,
    newcombe_ends,
    share_interval,
    wilson_interval,
)

#: Confidence level of every interval.
LEVEL = 0.95

_mean_interval = jax.jit(mean_interval, static_argnames=("axis", "level"))
_share_interval = jax.jit(share_interval, static_argnames="level")
_wilson_interval = jax.jit(wilson_interval, static_argnames="level")


class Estimate(NamedTuple):
    """A rate or mean for each of P objects, and for all objects (last).

    Attributes:
        value: ``[P + 1]``.
        standard_error: ``[P + 1]``; NaN for a single run.
        lower: ``[P + 1]``, lower end of the interval.
        upper: ``[P + 1]``, upper end.
        runs: ``[P + 1]``, number of runs that count.
    """

    value: np.ndarray
    standard_error: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    runs: np.ndarray


class Difference(NamedTuple):
    """A configuration minus its reference, on common seeds; ``[P + 1]`` each as in ``Estimate``.

    Attributes:
        value: positive if the configuration has the larger value.
        standard_error: of the runs' differences.
        lower: lower end of the interval.
        upper: upper end of the interval.
        runs: number of pairs that count.
        gained: for rates, number of runs in which only the configuration succeeds; otherwise NaN.
        lost: for rates, number of runs in which only the reference succeeds; otherwise NaN.
        p: two-sided p-value for no difference.
    """

    value: np.ndarray
    standard_error: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    runs: np.ndarray
    gained: np.ndarray
    lost: np.ndarray
    p: np.ndarray


def with_all(values: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Append the mean over objects as a last column.

    Args:
        values: ``[R, P]``, NaN where an object does not count.
        weights: ``[R, P]``.

    Returns:
        Values and weights ``[R, P + 1]``; the weights are 0 where the values are not finite.
    """
    weights = np.where(np.isfinite(values), weights, 0.0)
    total = np.sum(weights, axis=1, keepdims=True)
    mass = np.sum(weights * np.where(weights > 0, values, 0.0), axis=1, keepdims=True)
    pooled = np.where(total > 0, mass / np.where(total > 0, total, 1.0), np.nan)
    return np.concatenate([values, pooled], 1), np.concatenate([weights, total], 1)


def mean(values: np.ndarray, weights: np.ndarray, shares: bool = False) -> Estimate:
    """Means over runs of ``values [R, P]`` with ``weights [R, P]``.

    With ``shares``, the values are shares and the intervals stay in [0, 1].
    """
    values, weights = with_all(values, weights)
    interval = _mean_interval(values, weights, axis=0, level=LEVEL)
    if shares:
        interval = _share_interval(interval, level=LEVEL)
    return _estimate(interval, np.sum(weights > 0, axis=0))


def rate(outcomes: np.ndarray) -> Estimate:
    """Rates over runs of ``outcomes [R, P]``, which are 0, 1 or NaN."""
    values, weights = with_all(outcomes, np.ones_like(outcomes))
    runs = np.sum(weights > 0, axis=0)
    value, error = (_as_float64(x) for x in _mean_interval(values, axis=0, level=LEVEL)[:2])
    trials = runs.astype(np.float64)
    variance, share = error[-1] ** 2, value[-1]
    if 0 < share < 1 and np.isfinite(variance):
        most = np.sum(weights[:, -1])
        effective = share * (1 - share) / variance if variance > 0 else np.inf
        trials[-1] = np.clip(effective, trials[-1], most)
    successes = np.where(trials > 0, np.nan_to_num(value) * trials, 0)
    successes[:-1] = np.round(successes[:-1])
    wilson = _estimate(_wilson_interval(successes, trials, level=LEVEL), runs)
    wilson.standard_error[-1] = error[-1]
    return wilson


def without_interval(estimate: Estimate) -> Estimate:
    """Drop the intervals, for a tracker that is the same in every run."""
    unknown = np.full_like(estimate.value, np.nan)
    return estimate._replace(standard_error=unknown, lower=unknown, upper=unknown)


def mean_difference(
    values: np.ndarray,
    weights: np.ndarray,
    other_values: np.ndarray,
    other_weights: np.ndarray,
) -> Difference:
    """Difference of two weighted means over paired runs, ``[R, P]`` each.

    Each mean is a ratio of sums over runs.  The error is that of the linearised difference; for
    equal weights it is the standard error of the runs' differences.
    """
    ours, our_residuals, our_runs = _linearised(values, weights)
    theirs, their_residuals, their_runs = _linearised(other_values, other_weights)
    runs = np.minimum(our_runs, their_runs)
    squares = np.sum((our_residuals - their_residuals) ** 2, axis=0)
    with np.errstate(invalid="ignore"):
        error = np.sqrt(squares * runs / np.maximum(runs - 1, 1))
    value = ours - theirs
    error = np.where(runs > 1, error, np.nan)
    # Equal differences in every run leave only rounding error.
    scale = np.maximum(np.abs(ours), np.abs(theirs))
    error = np.where(error <= 1e-12 * scale, 0.0, error)
    value = np.where(np.abs(value) <= 1e-12 * scale, 0.0, value)
    freedom = np.maximum(runs - 1, 1)
    reach = stdtrit(freedom, (1 + LEVEL) / 2) * error
    with np.errstate(divide="ignore", invalid="ignore"):
        p = 2 * stdtr(freedom, -np.abs(value / error))
    # Without spread there is no test; p is 1 if both are equal in every run.
    p = np.where(error > 0, p, np.where((error == 0) & (value == 0), 1.0, np.nan))
    nothing = np.full_like(value, np.nan)
    return Difference(value, error, value - reach, value + reach, runs, nothing, nothing, p)


def rate_difference(outcomes: np.ndarray, other: np.ndarray) -> Difference:
    """Difference of rates over paired runs; outcomes ``[R, P]`` are 0, 1 or NaN."""
    ones = np.ones_like(outcomes)
    difference = mean_difference(outcomes, ones, other, ones)
    fields = {name: array.copy() for name, array in difference._asdict().items()}
    for index in range(outcomes.shape[1]):
        both = np.isfinite(outcomes[:, index]) & np.isfinite(other[:, index])
        ours, theirs = outcomes[both, index] > 0.5, other[both, index] > 0.5
        gained, lost = int(np.sum(ours & ~theirs)), int(np.sum(theirs & ~ours))
        fields["gained"][index], fields["lost"][index] = gained, lost
        if not len(ours):
            continue
        fields["lower"][index], fields["upper"][index] = newcombe_interval(
            int(np.sum(ours & theirs)), gained, lost, int(np.sum(~ours & ~theirs))
        )
        fields["p"][index] = mcnemar_p(gained, lost)
    return Difference(**fields)


def newcombe_interval(both: int, first: int, second: int, neither: int) -> tuple[float, float]:
    """Interval of p1 - p2 in a paired 2 x 2 table: Newcombe (1998), method 10.

    Args:
        both: number of pairs in which both succeed.
        first: number in which only the first succeeds.
        second: number in which only the second succeeds.
        neither: number in which both fail.
    """
    total = both + first + second + neither
    wins = np.array([both + first, both + second], float)
    lower, upper = (_as_float64(x) for x in _wilson_interval(wins, total, level=LEVEL)[2:])
    p = wins / total
    product = math.prod((both + first, second + neither, both + second, first + neither))
    determinant = float(both * neither - first * second)
    if determinant > 0:  # Newcombe's continuity correction
        determinant = max(determinant - total / 2, 0)
    phi = determinant / math.sqrt(product) if product else 0.0
    ours, theirs = np.stack([p, lower, upper], axis=1).tolist()
    return newcombe_ends(ours, theirs, phi)


def mcnemar_p(gained: int, lost: int) -> float:
    """p-value of McNemar's exact two-sided test that gains and losses are equally likely."""
    return min(1.0, 2 * float(bdtr(min(gained, lost), gained + lost, 0.5)))


def holm(p: ArrayLike) -> np.ndarray:
    """Adjust p-values for a family of comparisons (Holm 1979); NaN entries are not counted."""
    p = np.asarray(p, np.float64)
    adjusted = np.full(p.shape, np.nan)
    finite = np.flatnonzero(np.isfinite(p))
    order = finite[np.argsort(p[finite], kind="stable")]
    factors = len(order) - np.arange(len(order))
    adjusted[order] = np.minimum(np.maximum.accumulate(factors * p[order]), 1.0)
    return adjusted


def _linearised(
    values: np.ndarray, weights: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mean ``[P + 1]``, influence of each run ``[R, P + 1]``, and number of runs that count."""
    values, weights = with_all(values.astype(np.float64), weights)
    total = np.sum(weights, axis=0)
    share = weights / np.where(total > 0, total, 1)
    weighted = np.where(weights > 0, values, 0.0)
    value = np.where(total > 0, np.sum(share * weighted, axis=0), np.nan)
    residuals = np.where(weights > 0, share * (weighted - np.nan_to_num(value)), 0.0)
    return value, residuals, np.sum(weights > 0, axis=0)


def _estimate(interval: Interval, runs: np.ndarray) -> Estimate:
    value, standard_error, lower, upper = map(_as_float64, interval)
    return Estimate(value, standard_error, lower, upper, runs)


def _as_float64(values: object) -> np.ndarray:
    return np.array(values, np.float64)
