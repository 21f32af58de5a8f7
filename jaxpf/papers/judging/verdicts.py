"""The stored verdicts on the papers' claims, and their printed form.

Each paper's folder holds ``claims.csv``; ``verdicts.csv``, which ``jaxpf reproduce`` writes, with a
row for each figure of a claim; ``not_judged.csv``, the paper's other claims, and why they have no
verdict; and ``earlier.csv``, figures that were measured once and are no longer repeated, with the
date, the commit and the reason.  Their keys once stood in ``verdicts.csv``.
"""

import collections
import itertools
import textwrap
from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from statistics import NormalDist

from jaxpf.files.writing import csv_text
from jaxpf.papers.judging.claims import (
    CONTRADICTED,
    EQUAL,
    GROUPS,
    NOT_SEEN,
    OPEN,
    PREVIEW,
    SUPPORTED,
    WEAKER,
    Judged,
    claims_of,
    judge,
    read_rows,
)
from jaxpf.papers.judging.estimates import Quantity

#: Columns of ``verdicts.csv``: a figure with its interval at a level, from a number of units (0 if
#: it is computed), and the verdict on its claim.
STORED = (
    *("key", "what", "value", "low", "high", "level", "units"),
    *("verdict", "needed", "command", "version"),
)
COLUMNS = ("claim", "published", "ours", "verdict")
#: Form of each paper's method in which its own claims are judged.
FORMS = {
    "smith2004": "DPS with the paper's reassembly",
    "gonzales2011": "SPS with the paper's swap",
    "rowe2005": "eq. 4 as printed",
    "eskil2014": "of our parametrisation, as printed only where said",
    "maccormick1999": "each edge counts once, as printed where said",
}
#: Width of each column in characters; at most 100 in total, including spaces between columns.
_WIDTHS = (44, 15, 26, 12)
#: Heading of ``earlier.csv``.
EARLIER = "measured earlier, no longer repeated"


def stored(paper: str) -> list[Judged]:
    """A paper's claims with their stored verdicts."""
    claims, judged = claims_of(paper), []
    for key, rows in itertools.groupby(read_rows(paper, "verdicts.csv"), lambda row: row["key"]):
        figures = []
        for row in rows:
            value, low, high, level = (float(row[name]) for name in STORED[2:6])
            interval = partial(_widened, value, low, high, level)
            figures.append(Quantity(value, interval, int(row["units"]), row["what"]))
        needed = float(row["needed"]) if row["needed"] else None
        rest = row["verdict"], level, needed, row["command"], row["version"]
        judged.append(Judged(claims[key], figures, *rest))
    return judged


def _widened(
    value: float, low: float, high: float, stored: float, level: float
) -> tuple[float, float]:
    """The interval at another level than the stored one, widened as that of a normal mean."""
    if level == stored:
        return low, high
    wider = NormalDist().inv_cdf((1 + level) / 2) / NormalDist().inv_cdf((1 + stored) / 2)
    return value - wider * (value - low), value + wider * (high - value)


def csv_of(judged: Iterable[Judged]) -> str:
    """The content of ``verdicts.csv``: a row for each figure, with the verdict on its claim."""
    rows: list[Sequence[object]] = [STORED]
    for each in judged:
        needed = "" if each.needed is None else f"{each.needed:.0f}"
        verdict = each.verdict, needed, each.command, each.version
        for figure in each.figures:
            numbers = *figure.measured(each.level), each.level, figure.units
            rows.append([each.claim.key, figure.what, *numbers, *verdict])
    return csv_text(rows)


def judged_again(judged: Judged) -> Judged:
    """Judge stored figures by today's rule and claim; what stays open needs as many scenes."""
    again = judge(judged.claim, judged.figures, judged.level)
    needed = judged.needed if again.verdict == judged.verdict else again.needed
    return judged._replace(verdict=again.verdict, needed=needed)


def of_group(judged: Iterable[Judged], group: str) -> list[Judged]:
    """The claims of one group of ``GROUPS``."""
    return [each for each in judged if each.claim.group == group]


def summary(paper: str, judged: Sequence[Judged]) -> str:
    """Count the paper's own supported claims: "rowe2005: 9 of 12 supported, 3 open"."""
    own = [each.verdict for each in of_group(judged, "paper")]
    if PREVIEW in own:
        return f"{paper}: a preview, too few scenes to judge its claims"
    counts = collections.Counter(WEAKER if each.startswith(EQUAL) else each for each in own)
    words = (CONTRADICTED, NOT_SEEN, WEAKER, OPEN)
    others = "".join(f", {counts[word]} {word}" for word in words if counts[word])
    return f"{paper}: {counts[SUPPORTED]} of {len(own)} supported{others}"


def origin(judged: Sequence[Judged]) -> str:
    """The basis of most of the paper's own claims: scenes and level."""
    texts = [
        f"{each.units}, {100 * each.level:.4g}% intervals"
        for each in of_group(judged, "paper")
        if each.units != "computed"
    ]
    most = max(texts, key=texts.count, default="computed")
    others = len(texts) - texts.count(most)
    return f"{most}; {others} row{'s' * (others > 1)} otherwise" if others else most


def lines(judged: Sequence[Judged], details: bool = False) -> Iterator[str]:
    """The claims as lines of at most 100 characters.

    Args:
        judged: claims with their verdicts.
        details: add the full sentence, its source and all figures under each line.
    """
    for each in judged:
        word = each.verdict.replace(NOT_SEEN, "not seen").replace(WEAKER, "weaker")
        word = word.replace(f"{EQUAL} ", "equal ±")
        cells = each.claim.claim, each.claim.published, each.ours, word
        yield _line(cells)
        if details:
            yield from textwrap.wrap(detail(each), 98, initial_indent="  ", subsequent_indent="  ")


def _line(cells: Sequence[str]) -> str:
    padded = (f"{cell:<{width}}" for cell, width in zip(cells, _WIDTHS, strict=True))
    return " ".join(padded).rstrip()


def detail(judged: Judged) -> str:
    """The full text behind a line: claim, source, every figure, and caveats."""
    claim, units = judged.claim, judged.units
    if units != "computed":
        units += f", {100 * judged.level:.4g}%"
    remark = judged.remark and f".  {judged.remark[0].upper()}{judged.remark[1:]}"
    ours = f"Ours: {judged.shown} ({units})"
    return f"{claim.sentence[:-1]} ({claim.source}).  {ours}{remark}."


def report(paper: str, judged: Sequence[Judged], details: bool = False) -> Iterator[str]:
    """All lines about a paper: its own claims; with ``details`` all others, judged or not."""
    yield summary(paper, judged)
    if not judged:
        return
    yield f"({FORMS[paper]}; {origin(judged)})"
    yield _line(COLUMNS)
    yield from lines(of_group(judged, "paper"), details)
    if not details:
        return
    for group, title in list(GROUPS.items())[1:]:
        if others := of_group(judged, group):
            yield f"\n{paper}, {title}:"
            yield from lines(others, details)
    yield f"\n{paper}, not judged:"
    for row in read_rows(paper, "not_judged.csv"):
        text = f"- {row['claim']} ({row['source']}): {row['reason']}"
        yield from textwrap.wrap(text, 98, subsequent_indent="  ")
    yield f"\n{paper}, {EARLIER}:"
    for row in read_rows(paper, "earlier.csv"):
        text = (
            f"- {row['claim']} ({row['published']}): {row['figures']} ({row['units']}, "
            f"{row['date']}, commit {row['commit']}).  {row['reason']}"
        )
        yield from textwrap.wrap(text, 98, subsequent_indent="  ")
