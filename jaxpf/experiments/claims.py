"""Judging published claims by measured intervals.

A claim says that some quantities lie in some ranges: "DPS recovers more often than PS" says
that a difference of rates lies above 0, at each of four settings.  The rule, for a claim of k
parts at the level 95 %:

* *supports*: every part's 95 % interval lies in its claimed range.  (Asking this of all parts
  needs no correction: a false claim is false in some part, which passes in at most 2.5 % of
  the replications on either side.)
* *contradicts*: some part's interval at the level 1 - .05 / k (Bonferroni: with many parts one
  or another would stray by chance) lies outside its claimed range.
* *cannot resolve*: all else; more runs would be needed.
"""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from jaxpf.measures.intervals import student_quantile, wilson_interval

SUPPORTS, CONTRADICTS, CANNOT_RESOLVE = "supports", "contradicts", "cannot resolve"

#: The rule in one sentence, for reports.
RULE = (
    "A claim is supported if the 95 % interval of every quantity it speaks of lies in the claimed "
    "range, contradicted if the interval of one of them (Bonferroni-corrected for their number) "
    "lies outside, and otherwise cannot be resolved at this number of runs."
)


class Measured(NamedTuple):
    """A figure and its 95 % interval, in the units of the table it stands in."""

    value: float
    low: float
    high: float


class Quantity(NamedTuple):
    """One part of a claim.

    Attributes:
        what: for reports, such as "DPS - PS at 20".
        value: the estimate.
        interval: level -> its confidence interval (low, high).
        at_least: lower end of the claimed range.
        at_most: upper end of the claimed range.
    """

    what: str
    value: float
    interval: Callable[[float], tuple[float, float]]
    at_least: float = -math.inf
    at_most: float = math.inf

    def measured(self, level: float = 0.95) -> Measured:
        """The figure with its interval."""
        return Measured(self.value, *self.interval(level))


class Claim(NamedTuple):
    """A published claim beside what was measured.

    Attributes:
        statement: the claim in one sentence.
        source: where the paper makes it.
        published: the published figures behind it.
        measured: ours, with intervals.
        verdict: ``SUPPORTS``, ``CONTRADICTS`` or ``CANNOT_RESOLVE``.
    """

    statement: str
    source: str
    published: str
    measured: str
    verdict: str


def verdict(parts: Sequence[Quantity], level: float = 0.95) -> str:
    """Judge a claim by its parts; see the module's docstring.

    An interval that is not finite (NaN: nothing was measured) resolves nothing.
    """
    if not parts:
        return CANNOT_RESOLVE
    corrected = 1 - (1 - level) / len(parts)
    if any(_lies_outside(part, part.interval(corrected)) for part in parts):
        return CONTRADICTS
    if all(_lies_inside(part, part.interval(level)) for part in parts):
        return SUPPORTS
    return CANNOT_RESOLVE


def judged(
    statement: str,
    source: str,
    published: str,
    parts: Sequence[Quantity],
    level: float = 0.95,
    digits: int = 0,
) -> Claim:
    """The claim with its verdict and a sentence of what was measured."""
    return Claim(statement, source, published, shown(parts, digits), verdict(parts, level))


def shown(parts: Sequence[Quantity], digits: int = 0) -> str:
    """The parts' figures with their 95 % intervals, in one line."""
    pieces = []
    for part in parts:
        value, low, high = part.measured()
        interval = f"{value:.{digits}f} [{low:.{digits}f}, {high:.{digits}f}]"
        pieces.append(f"{part.what}: {interval}" if part.what else interval)
    return "; ".join(pieces)


def _lies_inside(part: Quantity, interval: tuple[float, float]) -> bool:
    low, high = interval
    return part.at_least < low and high < part.at_most


def _lies_outside(part: Quantity, interval: tuple[float, float]) -> bool:
    low, high = interval
    return high < part.at_least or low > part.at_most


def student_interval(values: np.ndarray) -> Callable[[float], tuple[float, float]]:
    """Intervals for the mean of independent values ``[n]`` by Student's t.

    Values that are NaN are left out.  Fewer than two leave no interval: NaN.
    """
    values = np.asarray(values, float)
    values = values[np.isfinite(values)]
    n = len(values)
    mean = float(values.mean()) if n else math.nan
    error = float(values.std(ddof=1)) / math.sqrt(n) if n > 1 else math.nan

    def interval(level: float) -> tuple[float, float]:
        reach = student_quantile(n - 1, level) * error
        return mean - reach, mean + reach

    return interval


def cluster_interval(rates: np.ndarray, trials: int) -> Callable[[float], tuple[float, float]]:
    """Intervals for a rate from clusters of trials that resemble each other, in percent.

    Wilson's interval at the effective number of trials: the number that would give independent
    trials the variance seen between clusters, at most all of them, and reduced for the few
    degrees of freedom of that variance (Korn and Graubard, Survey Methodology 1998, with
    Wilson's interval in place of Clopper and Pearson's).  At a rate of 0 or 1 nothing is seen of
    the variance between clusters: then each counts as one trial.

    Args:
        rates: ``[n]``, each cluster's rate, 0 to 1.
        trials: per cluster.
    """
    from scipy.special import ndtri

    rates = np.asarray(rates, float)
    n, p = len(rates), float(np.mean(rates))

    def interval(level: float) -> tuple[float, float]:
        effective = float(n)
        if 0 < p < 1 and n > 1:
            between = float(np.var(rates, ddof=1)) / n
            design = max(between * n * trials / (p * (1 - p)), 1.0)
            normal = float(ndtri(0.5 + level / 2))
            effective = n * trials / design * (normal / student_quantile(n - 1, level)) ** 2
        return wilson(p * effective, effective)(level)

    return interval


def wilson(successes: float, trials: float) -> Callable[[float], tuple[float, float]]:
    """Wilson's intervals for a rate, as percentages; [0, 100] without trials."""

    def interval(level: float) -> tuple[float, float]:
        result = wilson_interval(successes, trials, level)
        return 100 * float(result.lower), 100 * float(result.upper)

    return interval


def newcombe(
    successes: tuple[float, float], trials: tuple[float, float]
) -> Callable[[float], tuple[float, float]]:
    """Intervals for the difference of two independent rates, first minus second, in points.

    Newcombe's hybrid score interval (Statistics in Medicine 1998, method 10), which is built
    from Wilson's intervals of the two rates.
    """
    first, second = (100 * k / n if n else math.nan for k, n in zip(successes, trials, strict=True))

    def interval(level: float) -> tuple[float, float]:
        low_1, high_1 = wilson(successes[0], trials[0])(level)
        low_2, high_2 = wilson(successes[1], trials[1])(level)
        difference = first - second
        return (
            difference - math.hypot(first - low_1, high_2 - second),
            difference + math.hypot(high_1 - first, second - low_2),
        )

    return interval
