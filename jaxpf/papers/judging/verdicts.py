"""The stored verdicts on the papers' claims, and the claims that have none.

Each paper's folder holds ``verdicts.csv``, the ``claims.csv`` of a run of ``jaxpf reproduce`` with
the command that repeats it, and ``not_judged.csv``: what else the paper claims, and why no verdict
is given.
"""

import csv
from collections.abc import Sequence
from pathlib import Path

_PAPERS = Path(__file__).parents[1]


def stored(paper: str) -> list[dict[str, str]]:
    """A paper's claims with their verdicts and where these come from, column -> text."""
    return _rows(paper, "verdicts.csv")


def not_judged(paper: str) -> list[dict[str, str]]:
    """A paper's claims without a verdict: ``claim``, ``source`` and ``reason``."""
    return _rows(paper, "not_judged.csv")


def counted(claims: Sequence[dict[str, str]]) -> dict[str, int]:
    """Verdict -> number of claims, in the order in which verdicts are told."""
    from jaxpf.papers.judging.claims import CANNOT_RESOLVE, CONTRADICTS, EQUAL, SUPPORTS

    found = [claim["verdict"] for claim in claims]
    return {each: found.count(each) for each in (SUPPORTS, EQUAL, CONTRADICTS, CANNOT_RESOLVE)}


def overview(papers: Sequence[str]) -> tuple[list[str], list[list[str]]]:
    """Columns and rows of a table: how many claims of each paper have which verdict."""
    counts = {paper: counted(stored(paper)) for paper in papers}
    columns = ["claims of", *next(iter(counts.values())), "not judged"]
    rows = [
        [paper, *map(str, each.values()), str(len(not_judged(paper)))]
        for paper, each in counts.items()
    ]
    return columns, rows


def origin(claim: dict[str, str]) -> str:
    """What a stored claim's figures come from, beside the command that repeats them."""
    return f"{claim['runs']} runs, jaxpf {claim['version']}, {claim['date']}"


def _rows(paper: str, name: str) -> list[dict[str, str]]:
    path = _PAPERS / paper / name
    if not path.exists():
        return []
    with path.open(newline="") as file:
        return list(csv.DictReader(file))
