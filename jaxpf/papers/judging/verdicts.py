"""The stored verdicts on the papers' claims, and their printed form.

Each paper's folder holds ``claims.csv``; ``verdicts.csv``, which ``jaxpf reproduce`` writes;
``not_judged.csv``, the paper's other claims, and why they have no verdict; and ``earlier.csv``,
figures that were measured once and are no longer repeated.
"""

import re
import textwrap
from collections.abc import Iterable, Iterator, Sequence
from statistics import NormalDist

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
from jaxpf.papers.judging.estimates import Quantity, computed

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
    claims = claims_of(paper)
    return [
        Judged(claims[row["key"]], **{name: row[name] for name in Judged._fields[1:]})
        for row in read_rows(paper, "verdicts.csv")
    ]


def not_judged(paper: str) -> list[dict[str, str]]:
    """A paper's claims without a verdict: ``claim``, ``source`` and ``reason``."""
    return list(read_rows(paper, "not_judged.csv"))


def earlier(paper: str) -> list[dict[str, str]]:
    """Figures that are no longer measured: claim, published, figures, units, date, commit, reason.

    Their keys once stood in ``verdicts.csv``.
    """
    return list(read_rows(paper, "earlier.csv"))


def judged_again(judged: Judged) -> Judged:
    """Judge stored figures by today's rule and claim."""
    again = judge(judged.claim, _quantities(judged), float(judged.level or 95) / 100)
    remark = judged.remark if again.verdict == judged.verdict == OPEN else again.remark
    return judged._replace(verdict=again.verdict, remark=remark)


def _quantities(judged: Judged) -> list[Quantity]:
    """The figures of a stored row, as far as their digits go.

    An interval at a higher level than the stored one is widened as that of a normal mean.
    """
    number = r"(-?[\d.]+)"
    form = re.compile(rf"(?:(.*): )?{number}(?: \[{number}, {number}\])?")
    units = int(judged.units.split()[0]) if judged.units != "computed" else 0
    normal, stored = NormalDist(), float(judged.level or 95) / 100
    # Ends that are equal as printed differ by less than a digit, and a decided interval does not
    # touch the end of a range that its printed end equals.
    digit = 0.5 * 10.0**-judged.claim.digits
    inward = 0.0 if judged.verdict == OPEN else 1e-6 * digit

    def quantity(text: str) -> Quantity:
        match = form.fullmatch(text)
        assert match is not None, text
        what, *numbers = match.groups()
        value, low, high = (float(each or numbers[0]) for each in numbers)
        if not units:
            return computed(value, what or "")
        if low == high:
            low, high = low - digit, high + digit
        low, high = low + inward, high - inward

        def interval(level: float) -> tuple[float, float]:
            wider = normal.inv_cdf((1 + level) / 2) / normal.inv_cdf((1 + stored) / 2)
            return value - wider * (value - low), value + wider * (high - value)

        return Quantity(value, interval, units, what or "")

    return [quantity(text) for text in judged.figures.split("; ")]


def of_group(judged: Iterable[Judged], group: str) -> list[Judged]:
    """The claims of one group of ``GROUPS``."""
    return [each for each in judged if each.claim.group == group]


def summary(paper: str, judged: Sequence[Judged]) -> str:
    """Count the paper's own supported claims: "rowe2005: 9 of 12 supported, 3 open"."""
    own = [each.verdict for each in of_group(judged, "paper")]
    if PREVIEW in own:
        return f"{paper}: a preview, too few scenes to judge its claims"
    words = {CONTRADICTED: 0, NOT_SEEN: 0, WEAKER: 0, OPEN: 0}
    for verdict in own:
        word = WEAKER if verdict.startswith(EQUAL) else verdict
        if word in words:
            words[word] += 1
    others = "".join(f", {count} {word}" for word, count in words.items() if count)
    return f"{paper}: {own.count(SUPPORTED)} of {len(own)} supported{others}"


def origin(judged: Sequence[Judged]) -> str:
    """The basis of most of the paper's own claims: scenes and level."""
    texts = [
        f"{each.units}, {each.level}% intervals"
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
        units += f", {judged.level}%"
    remark = judged.remark and f".  {judged.remark[0].upper()}{judged.remark[1:]}"
    ours = f"Ours: {judged.figures} ({units})"
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
    if left := not_judged(paper):
        yield f"\n{paper}, not judged:"
        for row in left:
            text = f"- {row['claim']} ({row['source']}): {row['reason']}"
            yield from textwrap.wrap(text, 98, subsequent_indent="  ")
    if rows := earlier(paper):
        yield f"\n{paper}, {EARLIER}:"
        for row in rows:
            text = (
                f"- {row['claim']} ({row['published']}): {row['figures']} ({row['units']}, "
                f"{row['date']}, commit {row['commit']}).  {row['reason']}"
            )
            yield from textwrap.wrap(text, 98, subsequent_indent="  ")
