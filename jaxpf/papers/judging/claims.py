"""Published claims, and the rule that judges them by measured figures.

Each paper's ``claims.csv`` holds one row per claim: the range that the paper claims for its
figures, and our margin, by which an interval must lie outside that range to contradict the claim.
Range, margin and number of scenes (``Paper.scenes``) are fixed before measuring; the scenes are
evaluated once.

* *supported*: the 95% interval of every figure lies in the claimed range.  A false claim is false
  in some figure, which passes in at most 2.5% of the replications on either side.
* *not seen with our settings*: the interval of some figure, at the level 1 - 0.05 / k for k figures
  (Bonferroni), lies outside the range by more than the margin.
* *contradicted*: the same, where every free setting is the paper's or every plausible reading fails
  (column ``settings`` of ``claims.csv``: "paper").
* *weaker than claimed*, *equal within m*: not all figures lie in the range, but every interval lies
  within the margin; "equal" if all lie within m of a difference of 0.
* *open*: everything else, and all intervals of zero width except for computed figures.
* *preview*: fewer than ten scenes, which decide nothing.
"""

import csv
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from jaxpf.measures.intervals import DECISIVE, has_width
from jaxpf.papers.judging.estimates import Quantity

SUPPORTED, CONTRADICTED, OPEN, PREVIEW = "supported", "contradicted", "open", "preview"
NOT_SEEN, WEAKER, EQUAL = "not seen with our settings", "weaker than claimed", "equal within"
#: Value of ``Claim.settings`` where no free setting is ours.
PAPERS_OWN = "paper"
#: Kinds of claims, in display order; summaries count only the first.
GROUPS: Mapping[str, str] = {
    "paper": "claims of the paper",
    "variant": "our corrected methods, and other readings of the paper",
    "once": "seen once in the paper, not reproducible from what it states",
    "beyond": "beyond the paper",
}
#: The rule in one sentence, for reports.
RULE = (
    "A claim is supported if the 95% interval of every figure lies in the claimed range, which may "
    "be a direction alone.  It is "
    "not seen with our settings if that of one (Bonferroni-corrected) lies outside by more than "
    "our margin, and contradicted if no setting is ours.  It is weaker than claimed, or equal "
    "within a number, if every interval lies within the margin; otherwise open.  "
    f"Fewer than {DECISIVE} scenes are a preview and decide nothing.  The number of scenes is "
    "planned, and the data are analysed once, but for the exceptions on the page 'Five papers'.  "
    "Rows are not independent: several may share one claim."
)
#: Maximum number of scenes that a remark suggests.
_MOST_SCENES = 100_000


class Claim(NamedTuple):
    """A published claim: a row of ``claims.csv``.

    Attributes:
        key: identifier in the code.
        group: a key of ``GROUPS``.
        claim: at most eight words.
        published: the paper's figures, abbreviated.
        sentence: the full claim, with its figures and the origin of its range.
        source: place in the paper.
        at_least: lower end of the claimed range, or -inf.
        at_most: upper end, or inf.
        margin: our margin.
        digits: decimal places to show.
        unit: unit of counting, such as "scenes".
        settings: ``PAPERS_OWN`` if every free setting is the paper's or every plausible reading
            was tried; otherwise empty.
        measure: name of the measure that judges it, see ``jaxpf.papers.paper``; empty if a function
            of the paper does.
        variant: whose measure.
        against: the variant to compare with, or empty.
    """

    key: str
    group: str
    claim: str
    published: str
    sentence: str
    source: str
    at_least: float
    at_most: float
    margin: float
    digits: int
    unit: str
    settings: str = ""
    measure: str = ""
    variant: str = ""
    against: str = ""

    @property
    def ends(self) -> list[float]:
        """The finite ends of the claimed range."""
        return [end for end in (self.at_least, self.at_most) if math.isfinite(end)]

    def includes(self, low: float, high: float) -> bool:
        """Whether an interval lies in the range; False for NaN, as below."""
        return self.at_least < low and high < self.at_most

    def excludes(self, low: float, high: float) -> bool:
        """Whether it lies outside by more than the margin."""
        return high < self.at_least - self.margin or low > self.at_most + self.margin

    def is_near(self, low: float, high: float) -> bool:
        """Whether it lies in the range, or within the margin around one of its ends."""
        around = ((end - self.margin, end + self.margin) for end in self.ends)
        return self.includes(low, high) or any(a < low and high < b for a, b in around)


class Judged(NamedTuple):
    """A claim, its measured figures and the verdict on it: rows of ``verdicts.csv``.

    Attributes:
        claim: the claim.
        figures: the figures that decide it, at least one.
        verdict: see the module's docstring.
        level: level of the intervals that are shown.
        needed: number of scenes that would resolve an open claim, NaN if that cannot be estimated
            and infinite if no number would; None for other claims.
        command: command that repeats the measurement, with scenes and seed.
        version: version of this library.
    """

    claim: Claim
    figures: Sequence[Quantity]
    verdict: str
    level: float = 0.95
    needed: float | None = None
    command: str = ""
    version: str = ""

    @property
    def units(self) -> str:
        """What the verdict rests on, such as "50 scenes"."""
        count = min(each.units for each in self.figures)
        return counted(count, self.claim.unit) if count else "computed"

    @property
    def shown(self) -> str:
        """Every figure with its interval."""
        texts = []
        for each in self.figures:
            value, low, high = each.measured(self.level)
            text = self._span(value, value, low, high, each.units)
            texts.append(f"{each.what}: {text}" if each.what else text)
        return "; ".join(texts)

    @property
    def ours(self) -> str:
        """The smallest and the largest figure, and the hull of the intervals."""
        values, lows, highs = zip(
            *(each.measured(self.level) for each in self.figures), strict=True
        )
        known = max(each.units for each in self.figures) and math.isfinite(sum(highs) - sum(lows))
        return self._span(min(values), max(values), min(lows), max(highs), known)

    @property
    def remark(self) -> str:
        """How many scenes would resolve an open claim."""
        if self.needed is None:
            return ""
        if math.isnan(self.needed):
            return f"too few {self.claim.unit} to say more"
        if math.isinf(self.needed):
            return f"more {self.claim.unit} would not resolve it"
        return f"about {self.needed:.0f} {self.claim.unit} would resolve it"

    def _span(self, least: float, most: float, low: float, high: float, known: object) -> str:
        """``least to most [low, high]``, without ends if they are unknown."""
        first, last, *ends = (f"{x:z.{self.claim.digits}f}" for x in (least, most, low, high))
        span = first if first == last else f"{first} to {last}"
        return f"{span} [{', '.join(ends)}]" if known and math.isfinite(high - low) else span


def claims_of(paper: str) -> dict[str, Claim]:
    """Key -> claim of a paper, in display order."""
    return {row["key"]: _read(row) for row in read_rows(paper, "claims.csv")}


def read_rows(paper: str, name: str) -> Iterator[dict[str, str]]:
    """Read a CSV file in a paper's folder; yields nothing if it does not exist."""
    path = Path(__file__).parents[1] / paper / name
    if path.exists():
        with path.open(newline="", encoding="utf-8") as file:
            yield from csv.DictReader(file)


def _read(row: Mapping[str, str]) -> Claim:
    return Claim(
        **{name: row[name] for name in Claim._fields[:6]},
        at_least=float(row["at_least"] or "-inf"),
        at_most=float(row["at_most"] or "inf"),
        margin=float(row["margin"] or 0),
        digits=int(row["digits"] or 0),
        unit=row["unit"],
        **{name: row.get(name, "") for name in Claim._fields[11:]},
    )


def judge(claim: Claim, figures: Sequence[Quantity], level: float = 0.95) -> Judged:
    """Judge a claim by measured figures; see the module's docstring."""
    count = min(each.units for each in figures)
    verdict = PREVIEW if 0 < count < DECISIVE else _verdict(claim, figures, level)
    needed = _needed(growth(claim, figures, level), count) if verdict == OPEN else None
    return Judged(claim, figures, verdict, level, needed)


def judge_all(paper: str, measured: Mapping[str, Sequence[Quantity]]) -> list[Judged]:
    """Judge all claims of a paper for which figures were measured."""
    return [
        judge(claim, measured[key]) for key, claim in claims_of(paper).items() if measured.get(key)
    ]


def _verdict(claim: Claim, figures: Sequence[Quantity], level: float) -> str:
    corrected = 1 - (1 - level) / len(figures)
    if any(claim.excludes(*_certain(each, corrected)) for each in figures):
        return CONTRADICTED if claim.settings == PAPERS_OWN else NOT_SEEN
    intervals = [_certain(each, level) for each in figures]
    if all(claim.includes(*ends) for ends in intervals):
        return SUPPORTED
    if all(claim.at_least < each.value < claim.at_most for each in figures):
        return OPEN
    return _within(claim, intervals) if all(claim.is_near(*ends) for ends in intervals) else OPEN


def _certain(figure: Quantity, level: float) -> tuple[float, float]:
    """The interval; NaN if all scenes agree, which does not give certainty."""
    low, high = figure.interval(level)
    return (low, high) if figure.units == 0 or has_width(low, high) else (math.nan, math.nan)


def _within(claim: Claim, intervals: Sequence[tuple[float, float]]) -> str:
    """The verdict on a claim that is not met but every interval of which is near its range."""
    ends = [abs(end) for end in claim.ends]
    reach = max(ends) + claim.margin
    is_difference = min(ends) == max(ends) and (len(ends) == 2 or reach == claim.margin)
    if is_difference and all(-reach < low and high < reach for low, high in intervals):
        return f"{EQUAL} {reach:g}"
    if any(high < claim.at_least or low > claim.at_most for low, high in intervals):
        return WEAKER
    return OPEN


def counted(count: int, unit: str) -> str:
    """A number with its unit, such as "1 scene" or "50 scenes"."""
    return f"{count} {unit.removesuffix('s') if count == 1 else unit}"


def _needed(times: float, count: int) -> float:
    """How many scenes are that many times as many; infinite above a maximum."""
    if math.isnan(times):
        return math.nan
    return max(math.ceil(times * count), count + 1) if times * count <= _MOST_SCENES else math.inf


def growth(claim: Claim, figures: Sequence[Quantity], level: float = 0.95) -> float:
    """Factor on the number of scenes that would resolve a claim, if figures stay the same.

    Intervals shrink with the square root of the number of scenes.  NaN without intervals; infinite
    if a figure lies at an end of the range, or of the margin around it.
    """
    corrected = 1 - (1 - level) / len(figures)
    inside, outside, within, beyond = [], [], [], []
    for figure in figures:
        value, low, high = figure.measured(level)
        if not has_width(low, high):
            return math.nan
        above, below = value - claim.at_least, claim.at_most - value
        inside.append(max(_square(value - low, above), _square(high - value, below)))
        outside.append(min(_square(high - value, -above), _square(value - low, -below)))
        above, below = above + claim.margin, below + claim.margin
        within.append(max(_square(value - low, above), _square(high - value, below)))
        low, high = figure.interval(corrected)
        beyond.append(min(_square(high - value, -above), _square(value - low, -below)))
    return min(max(inside), min(beyond), max(*within, min(outside)))


def _square(reach: float, distance: float) -> float:
    """Factor on scenes that shrinks ``reach`` to ``distance``; infinite unless ``distance`` > 0."""
    return (reach / distance) ** 2 if distance > 0 else math.inf
