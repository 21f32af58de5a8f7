"""The stored verdicts: whole, honest about what they leave open, and short."""

import csv
from pathlib import Path

import pytest
from command_line import jaxpf

from jaxpf import papers
from jaxpf.papers import PAPERS
from jaxpf.papers.judging import verdicts
from jaxpf.papers.judging.claims import (
    CONTRADICTED,
    GROUPS,
    NOT_SEEN,
    OPEN,
    SUPPORTED,
    claims_of,
    judge_all,
    read_rows,
)
from jaxpf.papers.judging.estimates import computed
from jaxpf.papers.paper import paper_of


@pytest.mark.parametrize("paper", PAPERS)
def test_the_files_of_a_paper_are_whole(paper):
    """A comma without quotation marks cuts a sentence off."""
    for path in (Path(papers.__file__).parent / paper).glob("*.csv"):
        with path.open(newline="", encoding="utf-8") as file:
            header, *rows = csv.reader(file)
        assert {len(row) for row in rows} <= {len(header)}, path.name
    for name, columns in (("not_judged", "claim source reason"), ("settings", "setting value how")):
        rows = list(read_rows(paper, f"{name}.csv"))
        assert len(rows) > 3
        assert all(row[column] for row in rows for column in columns.split())
    assert all(all(row.values()) for row in read_rows(paper, "earlier.csv"))


@pytest.mark.parametrize("paper", PAPERS)
def test_a_claim_has_eight_words_a_sentence_and_a_verdict_that_says_what_it_rests_on(paper):
    claims, stored = claims_of(paper), verdicts.stored(paper)
    for key, claim in claims.items():
        assert len(claim.claim.split()) <= 8, key
        assert claim.sentence.endswith("."), key
        assert claim.group in GROUPS
        assert claim.source
        assert claim.at_least < claim.at_most
        if claim.margin:
            assert "ours" in claim.sentence or "Our margin" in claim.sentence
    assert len({each.claim.key for each in stored}) == len(stored) > 9
    for each in stored:
        assert each.command.startswith(f"jaxpf reproduce {paper}")
        assert each.version
        assert each.level >= 0.95
        assert ("resolve it" in each.remark) == (each.verdict == OPEN)


def test_stored_figures_are_judged_anew_if_the_claim_changes():
    (row,) = (each for each in verdicts.stored("rowe2005") if each.claim.key == "never_starves")
    assert row.verdict == SUPPORTED
    stricter = row._replace(claim=row.claim._replace(at_most=2))
    assert verdicts.judged_again(stricter).verdict == OPEN
    assert "resolve it" in verdicts.judged_again(stricter).remark
    other = row._replace(claim=row.claim._replace(at_least=8.0, at_most=9.0))
    assert verdicts.judged_again(other).verdict == NOT_SEEN


def test_verdicts_follow_from_the_stored_figures_and_are_written(tmp_path):
    assert jaxpf("verdicts", "-o", str(tmp_path / "new")).code == 0
    for paper in PAPERS:
        stored = Path(papers.__file__).parent / paper / "verdicts.csv"
        assert (tmp_path / "new" / paper / "verdicts.csv").read_text() == stored.read_text()


@pytest.mark.parametrize("paper", PAPERS)
def test_stored_figures_that_need_no_measurement_are_those_of_today(paper):
    stored = {each.claim.key: each for each in verdicts.stored(paper)}
    for each in judge_all(paper, paper_of(paper).computed()):
        shown = stored[each.claim.key]
        assert (shown.shown, shown.verdict, shown.units) == (each.shown, each.verdict, "computed")


def test_no_key_of_a_verdict_disappears():
    """The list has every key that ever stood in ``verdicts.csv``."""
    with (Path(__file__).parent / "verdict_keys.csv").open(newline="") as file:
        once = {(row["paper"], row["key"]) for row in csv.DictReader(file)}
    now = {(paper, each.claim.key) for paper in PAPERS for each in verdicts.stored(paper)}
    earlier = {(paper, row["key"]) for paper in PAPERS for row in read_rows(paper, "earlier.csv")}
    assert once <= now | earlier
    assert not now & earlier
    assert now <= once, "add the key to the list"


def test_the_summary_counts_the_papers_own_claims_and_the_origin_is_that_of_most():
    stored = verdicts.stored("rowe2005")
    own = verdicts.of_group(stored, "paper")[:5]
    assert 5 < len(verdicts.of_group(stored, "paper")) < len(stored)
    words = [CONTRADICTED, "equal within 3", OPEN, SUPPORTED, SUPPORTED]
    doubted = [each._replace(verdict=word) for each, word in zip(own, words, strict=True)]
    said = "rowe2005: 2 of 5 supported, 1 contradicted, 1 weaker than claimed, 1 open"
    assert verdicts.summary("rowe2005", doubted) == said
    assert verdicts.origin(own) == "75 scenes, 95% intervals"
    other = own[0]._replace(level=0.99)
    assert verdicts.origin([*own, other]) == "75 scenes, 95% intervals; 1 row otherwise"
    assert verdicts.origin([own[0]._replace(figures=[computed(1.0)])]) == "computed"


def test_all_papers_fit_on_two_screens_and_their_details_on_its_width():
    result = jaxpf("verdicts")
    assert result.code == 0, result.err
    lines = result.out.splitlines()
    assert len(lines) <= 100
    for paper in PAPERS:
        stored = verdicts.stored(paper)
        assert verdicts.summary(paper, stored) in lines
        lines += verdicts.report(paper, stored, details=True)
    assert max(map(len, lines)) <= 100


def test_details_print_the_sentence_and_the_other_claims():
    plain, detailed = jaxpf("verdicts", "rowe2005"), jaxpf("verdicts", "rowe2005", "--details")
    assert detailed.code == 0, detailed.err
    headings = ("beyond the paper:", "not judged:", f"{verdicts.EARLIER}:")
    for words in ("is our reading", *(f"rowe2005, {heading}" for heading in headings)):
        assert words in detailed.out
        assert words not in plain.out
    assert "smith2004:" not in detailed.out
