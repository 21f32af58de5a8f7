"""Estimates and paired differences over the runs of an evaluation, or over sequences.

Both are tables with a row per unit, which is a run or a sequence, and a column per measure and
object; NaN where a unit does not count.  Units are independent.  Frames and objects of one run are
correlated, so they contribute to its value but do not narrow the interval.  Measures with known
bounds are means, the others medians; see ``jaxpf.measures.intervals``.
"""

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from scipy.special import bdtr

from jaxpf.evaluation.measures import by_name
from jaxpf.measures.intervals import (
    Interval,
    difference_interval,
    difference_p_value,
    mean_interval,
    median_interval,
)

#: Confidence level of every interval.
LEVEL = 0.95
#: Name of all objects together in the tables.
ALL = "all"
#: Bounds of the measures that have any.
_SHARE = (0.0, 1.0)


def with_all(values: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Append the weighted mean over objects as a last object.

    Args:
        values: ``[R, P, ...]``, not finite where an object does not count.
        weights: of the same shape.

    Returns:
        Values, NaN where nothing counts, and weights, 0 there; ``[R, P + 1, ...]``.
    """
    weights = np.where(np.isfinite(values), weights, 0.0)
    values = np.where(weights > 0, values, np.nan)
    total = np.sum(weights, axis=1, keepdims=True)
    mass = np.sum(weights * np.nan_to_num(values), axis=1, keepdims=True)
    pooled = np.where(total > 0, mass / np.where(total > 0, total, 1.0), np.nan)
    return np.concatenate([values, pooled], 1), np.concatenate([weights, total], 1)


def estimate(values: pd.DataFrame, weights: pd.DataFrame | None = None) -> pd.DataFrame:
    """Means of shares, with the weights of the units, and medians of other measures.

    Returns:
        A row per column of ``values``: the number of ``runs`` that count, ``value``,
        ``standard_error`` (NaN for a single run, and for medians), and the ends of the interval,
        ``lower`` and ``upper`` (NaN with too few runs).
    """
    if weights is None:
        weights = values.notna().astype(float)
    shares = _are_shares(values)
    mass = _columns(weights, shares)
    means = mean_interval(_columns(values, shares), mass, level=LEVEL, bounds=_SHARE)
    medians = median_interval(_columns(values, ~shares), level=LEVEL)
    return _table(values, shares, means, medians)


def difference(ours: pd.DataFrame, theirs: pd.DataFrame, level: float = LEVEL) -> pd.DataFrame:
    """Mean differences of common units; median differences of measures without bounds.

    Args:
        ours: values of a configuration.
        theirs: those of its reference.
        level: confidence of the interval.

    Returns:
        A row per column as from ``estimate``; ``gained`` and ``lost``, the number of runs in which
        the configuration or the reference has the larger value; and a two-sided p-value for no
        difference, ``p``, below 0.05 where the 95% interval excludes 0: of rates McNemar's exact
        test, of medians the sign test.
    """
    units = ours.index.intersection(theirs.index)
    ours, theirs, shares = ours.loc[units], theirs.loc[units], _are_shares(ours)
    apart, pairs = ours - theirs, (_columns(ours, shares), _columns(theirs, shares))
    means = difference_interval(*pairs, level, _SHARE)
    medians = median_interval(_columns(apart, ~shares), level=level)
    table = _table(apart, shares, means, medians)
    # Equal values in every run may differ by rounding.
    sizes = np.abs([ours, theirs])
    scale = 1e-12 * np.max(sizes, axis=(0, 1), where=np.isfinite(sizes), initial=0)
    gained, lost, runs = (apart > scale).sum(), (apart < -scale).sum(), table.runs
    # Of medians, runs without a difference count on the other side.
    p = np.minimum(2 * bdtr(runs - np.maximum(gained, lost), runs, 0.5), 1.0).where(runs > 1)
    p[shares] = difference_p_value(*pairs, _SHARE)
    return table.assign(gained=gained, lost=lost, p=p)


def _are_shares(table: pd.DataFrame) -> np.ndarray:
    """Whether each column is of a measure with bounds."""
    names = table.columns.get_level_values("measure")
    return np.array([by_name(name).bounds is not None for name in names])


def _columns(table: pd.DataFrame, chosen: np.ndarray) -> np.ndarray:
    """Some columns, with contiguous rows: sums over rows then have one order for any choice."""
    return np.ascontiguousarray(table.to_numpy()[:, chosen])


def _table(
    values: pd.DataFrame, shares: np.ndarray, means: Interval, medians: Interval
) -> pd.DataFrame:
    ends = np.empty((len(Interval._fields), values.shape[1]))
    ends[:, shares], ends[:, ~shares] = means, medians
    fields = dict(zip(Interval._fields, ends, strict=True))
    return pd.DataFrame({"runs": np.isfinite(values).sum(), **fields}, index=values.columns)


def holm(p: ArrayLike) -> np.ndarray:
    """Adjust p-values for a family of comparisons (Holm 1979); NaN entries are not counted."""
    p = np.asarray(p, np.float64)
    adjusted = np.full(p.shape, np.nan)
    finite = np.flatnonzero(np.isfinite(p))
    order = finite[np.argsort(p[finite], kind="stable")]
    factors = len(order) - np.arange(len(order))
    adjusted[order] = np.minimum(np.maximum.accumulate(factors * p[order]), 1.0)
    return adjusted
