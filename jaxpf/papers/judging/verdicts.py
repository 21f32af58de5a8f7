"""The stored verdicts on the papers' claims, and their printed form.

Each paper's folder holds ``claims.csv``, ``verdicts.csv``, which ``jaxpf reproduce`` writes, and
``not_judged.csv``: the paper's other claims, and why they have no verdict.
"""

import textwrap
from collections.abc import Iterable, Iterator, Sequence

from jaxpf.papers.judging.claims import (
    CONTRADICTED,
    GROUPS,
    OPEN,
    PREVIEW,
    SUPPORTED,
    Judged,
    claims_of,
    read_rows,
)

COLUMNS = ("claim", "published", "ours", "verdict")
#: Form of each paper's method in which its own claims are judged.
FORMS = {
    "smith2004": "DPS with the paper's reassembly",
    "gonzales2011": "SPS with the paper's swap",
    "rowe2005": "eq. 4 as printed",
    "eskil2014": "equations as printed only where it says so",
    "maccormick1999": "an edge paid once, as printed where said",
}
#: Width of each column in characters; at most 100 in total, including spaces between columns.
_WIDTHS = (44, 16, 25, 12)


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


def of_group(judged: Iterable[Judged], group: str) -> list[Judged]:
    """The claims of one group of ``GROUPS``."""
    return [each for each in judged if each.claim.group == group]


def summary(paper: str, judged: Sequence[Judged]) -> str:
    """Count the paper's own claims that hold: "smith2004: 10 of 13 hold, 1 does not, 2 open"."""
    own = [each.verdict for each in of_group(judged, "paper")]
    if PREVIEW in own:
        return f"{paper}: a preview, too few scenes to judge its claims"
    hold, not_, open_ = (own.count(verdict) for verdict in (SUPPORTED, CONTRADICTED, OPEN))
    negation = "does" if not_ == 1 else "do"
    return f"{paper}: {hold} of {len(own)} hold, {not_} {negation} not, {open_} open"


def origin(judged: Sequence[Judged]) -> str:
    """The basis of most of the paper's own claims: scenes and level."""
    texts = [
        f"{each.units}, {each.level} % intervals"
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
        cells = each.claim.claim, each.claim.published, each.ours, each.verdict
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
        units += f", {judged.level} %"
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
