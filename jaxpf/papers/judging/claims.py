"""Judging published claims by measured intervals.

A claim says that some quantities lie in some ranges: "DPS recovers more often than PS" says
that a difference of rates lies above 0, at each of four settings.  The rule, for a claim of k
parts at the level 95 %:

* *supports*: every part's 95 % interval lies in its claimed range.  (Asking this of all parts
  needs no correction: a false claim is false in some part, which passes in at most 2.5 % of
  the replications on either side.)
* *contradicts*: some part's interval at the level 1 - .05 / k (Bonferroni: with many parts one
  or another would stray by chance) lies outside its claimed range, and of one that has a margin
  farther from it than that: the margin holds the error of the paper's own few runs.
* *equal within the margin*: neither, but the 95 % interval of every part lies in its range or, of
  one that has a margin, no farther from an end of the range than that.
* *cannot resolve*: all else; it is told how many runs would resolve it, if figures stay where they
  are and intervals shrink with the root of the number of runs.

Who looks again and again, with more runs each time, uses up level: look k has .05 / (k (k + 1)) of
it, ``at_look``, which sums to .05 over all looks, so that a verdict is right at whatever look it
falls, as often as one of a single look.  What does not grow with the runs, such as timings, is
looked at once.

An interval without a width is what two scenes that agree give, not certainty: it resolves nothing,
but for a quantity that is computed and has no chance in it (``exact``).
"""

import dataclasses
import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import numpy as np

from jaxpf.measures.intervals import (
    newcombe_ends,
    student_interval,
    student_quantile,
    wilson_interval,
)

SUPPORTS, CONTRADICTS, CANNOT_RESOLVE = "supports", "contradicts", "cannot resolve"
EQUAL = "equal within the margin"
#: What more would have to be measured is told up to this number of runs.
_MOST_RUNS = 10**6

#: The rule in one sentence, for reports.
RULE = (
    "A claim is supported if the 95 % interval of every quantity it speaks of lies in the claimed "
    "range, equal within the margin if all lie in their range or no farther from its end than a "
    "margin, where one is stated, contradicted if the interval of one of them "
    "(Bonferroni-corrected for their number) lies outside of both, and otherwise cannot be "
    "resolved at this number of runs.  With --until-resolved the intervals of the k-th look have "
    "the level 1 - .05 / (k (k + 1)) instead."
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
        margin: distance from an end of the range within which a figure counts as equal to it.
        chosen_among: figures of which this one was chosen by how it came out: its intervals are
            Bonferroni-corrected for as many.
    """

    what: str
    value: float
    interval: Callable[[float], tuple[float, float]]
    at_least: float = -math.inf
    at_most: float = math.inf
    margin: float = 0.0
    chosen_among: int = 1

    @property
    def is_exact(self) -> bool:
        """Whether there is no chance in it."""
        return isinstance(self.interval, _Exact)

    def at(self, level: float) -> tuple[float, float]:
        """The interval at a level, corrected for the choice."""
        return self.interval(1 - (1 - level) / self.chosen_among)

    def measured(self, level: float = 0.95) -> Measured:
        """The figure with its interval."""
        return Measured(self.value, *self.at(level))


class Claim(NamedTuple):
    """A published claim beside what was measured.

    Attributes:
        statement: the claim in one sentence.
        source: where the paper makes it.
        published: the published figures behind it.
        measured: ours, with intervals.
        verdict: ``SUPPORTS``, ``CONTRADICTS``, ``EQUAL`` or ``CANNOT_RESOLVE``.
        growth: how many times as much would have to be measured to resolve it; NaN if nobody
            knows, infinite if nothing would.
        unit: what more of would resolve it.
        parts: what it was judged by.
        digits: decimal places that are shown.
    """

    statement: str
    source: str
    published: str
    measured: str
    verdict: str
    growth: float = 1.0
    unit: str = "runs"
    parts: Sequence[Quantity] = ()
    digits: int = 0


def exact(value: float, what: str = "", **claimed: Any) -> Quantity:
    """A part of a claim that is computed."""
    return Quantity(what, value, _Exact(value), **claimed)


@dataclasses.dataclass(frozen=True)
class _Exact:
    value: float

    def __call__(self, level: float) -> tuple[float, float]:
        return self.value, self.value


def verdict(parts: Sequence[Quantity], level: float = 0.95) -> str:
    """Judge a claim by its parts; see the module's docstring.

    An interval that is not finite (NaN: nothing was measured) resolves nothing.
    """
    if not parts:
        return CANNOT_RESOLVE
    corrected = _corrected(parts, level)
    if any(_clearly(_lies_beyond, part, corrected) for part in parts):
        return CONTRADICTS
    if all(_clearly(_lies_inside, part, level) for part in parts):
        return SUPPORTS
    if all(_clearly(_lies_inside_or_near, part, level) for part in parts):
        return EQUAL
    return CANNOT_RESOLVE


def growth(parts: Sequence[Quantity], level: float = 0.95) -> float:
    """How many times as much would have to be measured to resolve a claim.

    If figures stay where they are: where one lies beyond its range and margin the claim is resolved
    once one of those does so clearly; and once all lie clearly inside, or near an end where that
    counts.
    """
    outside = [part for part in parts if _lies_beyond(part, (part.value, part.value))]
    needed = [_growth(part, _lies_beyond, _corrected(parts, level)) for part in outside]
    one_outside = min((each for each in needed if not math.isnan(each)), default=math.nan)
    needed = [_growth(part, _lies_inside_or_near, level) for part in parts]
    all_inside = math.nan if any(map(math.isnan, needed)) else max(needed, default=math.nan)
    if not outside:
        return all_inside
    return min(one_outside, all_inside) if one_outside == one_outside else all_inside


def _growth(part: Quantity, resolved: Callable[..., bool], level: float) -> float:
    """As ``growth``, for one part: NaN without an interval, infinite at the very end of a range.

    A score interval from g times as many trials is that at a level whose normal quantile is
    sqrt(g) times smaller; Student's is so nearly.
    """
    from scipy.special import ndtr, ndtri

    low, high = part.at(level)
    if not low < high:
        return math.nan
    level = 1 - (1 - level) / part.chosen_among
    fewest, most = 0.0, math.log(1e8)  # of the logarithm of g
    if not resolved(part, (part.value, part.value)):
        return math.inf
    for _ in range(40):
        middle = (fewest + most) / 2
        quantile = ndtri(0.5 + level / 2) * math.exp(-middle / 2)
        if resolved(part, part.interval(float(2 * ndtr(quantile) - 1))):
            most = middle
        else:
            fewest = middle
    return math.exp(most)


def _corrected(parts: Sequence[Quantity], level: float) -> float:
    return 1 - (1 - level) / len(parts)


def told(claim: Claim, runs: int) -> Claim:
    """The claim; one that cannot be resolved says what would resolve it.

    Args:
        claim: judged.
        runs: those it was judged by.
    """
    if claim.verdict != CANNOT_RESOLVE:
        return claim
    if math.isnan(claim.growth):
        remedy = f"too few {claim.unit} to tell how many would resolve it"
    elif math.isinf(claim.growth):
        remedy = f"no number of {claim.unit} would resolve it"
    elif claim.growth * runs > _MOST_RUNS:
        remedy = f"only over a million {claim.unit} would resolve it"
    elif claim.unit == "runs":
        remedy = f"about {max(math.ceil(claim.growth * runs), runs + 1)} runs would resolve it"
    else:
        remedy = f"about {claim.growth:.1f} times as many {claim.unit} would resolve it"
    return claim._replace(measured=f"{claim.measured}; {remedy}")


def judged(
    statement: str,
    source: str,
    published: str,
    *parts: Quantity,
    digits: int = 0,
    unit: str = "runs",
) -> Claim:
    """The claim with its verdict and a sentence of what was measured.

    Args:
        statement: the claim in one sentence.
        source: where the paper makes it.
        published: the published figures behind it.
        parts: what it speaks of.
        digits: decimal places to show.
        unit: what more of would resolve it.
    """
    measured, found = shown(parts, digits), verdict(parts)
    more = growth(parts) if found == CANNOT_RESOLVE else 1.0
    return Claim(statement, source, published, measured, found, more, unit, parts, digits)


def level_of(look: int) -> float:
    """The confidence level of the k-th look at data that grow."""
    return 1 - 0.05 / (look * (look + 1))


def grows(claim: Claim) -> bool:
    """Whether more runs tell more of a claim: timings, say, are as many at every look."""
    return claim.unit == "runs"


def at_look(claim: Claim, look: int) -> Claim:
    """A claim judged anew, at the k-th look at data that grow, from 1."""
    if not grows(claim):
        return claim
    level = level_of(look)
    found = verdict(claim.parts, level)
    return claim._replace(
        measured=claim.measured.replace(
            shown(claim.parts, claim.digits), shown(claim.parts, claim.digits, level)
        ),
        verdict=found,
        growth=growth(claim.parts, level) if found == CANNOT_RESOLVE else 1.0,
    )


def shown(parts: Sequence[Quantity], digits: int = 0, level: float = 0.95) -> str:
    """The parts' figures with their intervals, in one line."""
    pieces = []
    for part in parts:
        value, low, high = part.measured(level)
        interval = f"{value:.{digits}f} [{low:.{digits}f}, {high:.{digits}f}]"
        pieces.append(f"{part.what}: {interval}" if part.what else interval)
    return "; ".join(pieces)


def _clearly(holds: Callable[..., bool], part: Quantity, level: float) -> bool:
    low, high = part.at(level)
    return (low < high or part.is_exact) and holds(part, (low, high))


def _lies_inside(part: Quantity, interval: tuple[float, float]) -> bool:
    low, high = interval
    return part.at_least < low and high < part.at_most


def _lies_inside_or_near(part: Quantity, interval: tuple[float, float]) -> bool:
    low, high = interval
    near = (
        end - part.margin < low and high < end + part.margin
        for end in (part.at_least, part.at_most)
        if math.isfinite(end)
    )
    return _lies_inside(part, interval) or any(near)


def _lies_beyond(part: Quantity, interval: tuple[float, float]) -> bool:
    low, high = interval
    return high < part.at_least - part.margin or low > part.at_most + part.margin


def student(values: np.ndarray) -> Callable[[float], tuple[float, float]]:
    """Student's intervals for the mean of independent values ``[n]``; NaN from fewer than two."""

    def interval(level: float) -> tuple[float, float]:
        found = student_interval(values, level)
        return float(found.lower), float(found.upper)

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


#: What resolves a claim is searched for with thousands of intervals.
_wilson_interval = jax.jit(wilson_interval)


def wilson(successes: float, trials: float) -> Callable[[float], tuple[float, float]]:
    """Wilson's intervals for a rate, as percentages; [0, 100] without trials."""

    def interval(level: float) -> tuple[float, float]:
        result = _wilson_interval(successes, trials, level)
        return 100 * float(result.lower), 100 * float(result.upper)

    return interval


def newcombe(
    successes: tuple[float, float], trials: tuple[float, float]
) -> Callable[[float], tuple[float, float]]:
    """Intervals for the difference of two independent rates, first minus second, in points.

    See ``jaxpf.measures.intervals.newcombe_ends``.
    """
    first, second = (100 * k / n if n else math.nan for k, n in zip(successes, trials, strict=True))

    def interval(level: float) -> tuple[float, float]:
        ends = (wilson(k, n)(level) for k, n in zip(successes, trials, strict=True))
        return newcombe_ends((first, *next(ends)), (second, *next(ends)))

    return interval
