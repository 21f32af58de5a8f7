"""Rates and means with standard errors and confidence intervals."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.scipy.special import ndtri
from jax.typing import ArrayLike

from jaxpf.contract.errors import InputError
from jaxpf.contract.numbers import check_array, check_together, numbers_in
from jaxpf.contract.pytree import is_concrete


class Interval(NamedTuple):
    """An estimate with its uncertainty; all four fields have the same shape.

    Attributes:
        value: the mean or the rate.
        standard_error: the estimated standard deviation of ``value``.
        lower: lower end of the confidence interval.
        upper: upper end of the confidence interval.
    """

    value: Any
    standard_error: Any
    lower: Any
    upper: Any


def wilson_interval(successes: ArrayLike, trials: ArrayLike, level: ArrayLike = 0.95) -> Interval:
    """A rate with the confidence interval of Wilson (1927).

    With n trials, k successes, p = k / n and z the normal quantile of the level, the ends are
    (p + z^2 / 2n +- z sqrt(p (1 - p) / n + z^2 / 4n^2)) / (1 + z^2 / n).  Unlike p +- z times the
    standard error, the interval stays in [0, 1] and does not collapse at 0 or n successes.

    Args:
        successes: k, ``[...]``.
        trials: n, ``[...]``; for n = 0 the rate is NaN and the interval [0, 1].
        level: confidence, in (0, 1).

    Returns:
        ``[...]`` each.
    """
    check_together(successes=successes, trials=trials)
    successes, trials = jnp.broadcast_arrays(as_float(successes), as_float(trials))
    z = _quantile(level)
    any_trials = trials > 0
    n = jnp.where(any_trials, trials, 1)
    p = successes / n
    variance = p * (1 - p) / n
    middle = (p + z**2 / (2 * n)) / (1 + z**2 / n)
    reach = z * jnp.sqrt(variance + z**2 / (4 * n**2)) / (1 + z**2 / n)
    # At 0 and n successes an end is exactly 0 or 1; avoid rounding beyond it.
    lower = jnp.where(successes <= 0, 0.0, jnp.clip(middle - reach, 0, 1))
    upper = jnp.where(successes >= n, 1.0, jnp.clip(middle + reach, 0, 1))
    return Interval(
        value=jnp.where(any_trials, p, jnp.nan),
        standard_error=jnp.where(any_trials, jnp.sqrt(variance), jnp.nan),
        lower=jnp.where(any_trials, lower, 0.0),
        upper=jnp.where(any_trials, upper, 1.0),
    )


def share_interval(share: Interval, level: ArrayLike = 0.95) -> Interval:
    """Replace the interval of a mean of shares by Wilson's, which stays in [0, 1].

    It uses the effective number of trials, p (1 - p) / SE^2 (Korn and Graubard 1998).  If the runs
    do not vary, or there is only one, the interval is unchanged.
    """
    value, error = share.value, share.standard_error
    varies = (error > 0) & (value > 0) & (value < 1)
    trials = jnp.where(varies, value * (1 - value) / jnp.where(varies, error, 1) ** 2, 1)
    wilson = wilson_interval(jnp.where(varies, value, 0) * trials, trials, level)
    lower = jnp.where(varies, wilson.lower, share.lower)
    return Interval(value, error, lower, jnp.where(varies, wilson.upper, share.upper))


def newcombe_ends(
    first: Sequence[float], second: Sequence[float], correlation: float = 0.0
) -> tuple[float, float]:
    """Ends of the interval of a difference of two rates, first minus second.

    Newcombe's hybrid score interval (1998, Statistics in Medicine 17:2635, method 10).

    Args:
        first: a rate and the ends of its Wilson interval.
        second: the same for the second rate, at the same level.
        correlation: phi of paired trials; 0 for independent trials.
    """
    (one, low_1, high_1), (other, low_2, high_2) = first, second

    def reach(a: float, b: float) -> float:
        return math.sqrt(max(a**2 - 2 * correlation * a * b + b**2, 0))

    return (
        one - other - reach(one - low_1, high_2 - other),
        one - other + reach(high_1 - one, other - low_2),
    )


def mean_interval(
    values: ArrayLike,
    weights: ArrayLike | None = None,
    axis: int = 0,
    level: ArrayLike = 0.95,
) -> Interval:
    """A weighted mean over independent runs with its standard error and normal interval.

    The mean is m = sum_r w_r x_r / sum_r w_r and the squared standard error
    R / (R - 1) sum_r w_r^2 (x_r - m)^2 / (sum_r w_r)^2, which for equal weights is the sample
    variance over R.  With per-run means as values and frame counts as weights, m is the mean over
    pooled frames and the error accounts for the correlation of frames within a run.

    Args:
        values: ``[..., R, ...]``; values that are not finite are left out.
        weights: w >= 0, broadcasting with ``values``; equal by default.
        axis: the axis of the runs.
        level: confidence, in (0, 1).

    Returns:
        The shape of ``values`` without the axis.  The mean of no runs is NaN; the error and the
        interval are NaN with fewer than two runs.
    """
    weights = 1.0 if weights is None else weights
    check_together(values=values, weights=weights)
    values, mass = jnp.broadcast_arrays(as_float(values), as_float(weights))
    counts = jnp.isfinite(values) & (mass > 0)
    mass = jnp.where(counts, mass, 0)
    total = jnp.sum(mass, axis, keepdims=True)
    share = mass / jnp.where(total > 0, total, 1)
    values = jnp.where(counts, values, 0)
    mean = jnp.sum(share * values, axis, keepdims=True)
    runs = jnp.sum(counts, axis)
    squares = jnp.sum((share * (values - mean)) ** 2, axis)
    error = jnp.sqrt(squares * runs / jnp.maximum(runs - 1, 1))
    error = jnp.where(runs > 1, error, jnp.nan)
    value = jnp.where(runs > 0, jnp.squeeze(mean, axis), jnp.nan)
    reach = _quantile(level) * error
    return Interval(value, error, value - reach, value + reach)


def student_interval(values: ArrayLike, level: float = 0.95) -> Interval:
    """A mean over few independent units with Student's interval, in double precision.

    Args:
        values: ``[n]``; values that are not finite are left out.
        level: confidence, in (0, 1).

    Returns:
        Scalars.  The mean of no units is NaN; the error and the interval are NaN with fewer than
        two units.
    """
    numbers = numbers_in("values", values, "numbers, [n]")
    numbers = numbers[np.isfinite(numbers)]
    count = len(numbers)
    mean = numbers.mean() if count else np.float64(np.nan)
    error = numbers.std(ddof=1) / np.sqrt(count) if count > 1 else np.float64(np.nan)
    reach = student_quantile(count - 1, level) * error
    return Interval(mean, error, mean - reach, mean + reach)


def masked_mean(values: ArrayLike, mask: ArrayLike, axis: int | Sequence[int]) -> Array:
    """Mean of the finite values where ``mask`` is true; NaN if there are none."""
    check_together(values=values, mask=mask)
    values = as_float(values)
    axis = axis if isinstance(axis, int) else tuple(axis)
    counts = jnp.isfinite(values) & jnp.asarray(mask, bool)
    total = jnp.sum(jnp.where(counts, values, 0), axis)
    number = jnp.sum(counts, axis)
    return jnp.where(number > 0, total / jnp.maximum(number, 1), jnp.nan)


def student_quantile(freedom: float, level: float = 0.95) -> float:
    """t with ``P(|T| < t) = level`` for Student's T; ``freedom`` below 1 counts as 1."""
    from scipy.special import stdtrit

    check_level(level)
    check_array("freedom", freedom, "the degrees of freedom, []")
    return float(stdtrit(max(freedom, 1), 0.5 + level / 2))


def _quantile(level: ArrayLike) -> Array:
    """z with P(|normal| < z) = level."""
    check_level(level)
    return ndtri((1 + jnp.asarray(level)) / 2)


def check_level(level: ArrayLike) -> None:
    """Refuse a confidence that is not above 0 and below 1."""
    if not is_concrete(level):
        return
    check_array("level", level, "above 0 and below 1, such as 0.95")
    levels = np.asarray(level)
    if not (levels.size and np.all((levels > 0) & (levels < 1))):
        raise InputError(f"level={level!r} must be above 0 and below 1, such as 0.95.")


def as_float(values: ArrayLike) -> Array:
    """Convert to a float array; integers and bools become the default float."""
    values = jnp.asarray(float(values) if isinstance(values, int) else values)
    return values.astype(jnp.result_type(values.dtype, jnp.float32))
