"""The stored verdicts: whole, honest about what they leave open, and short."""

from pathlib import Path

import pytest
from command_line import jaxpf

from jaxpf.papers.gonzales2011 import claims as gonzales2011
from jaxpf.papers.judging import verdicts
from jaxpf.papers.judging.claims import (
    CONTRADICTED,
    GROUPS,
    OPEN,
    SUPPORTED,
    claims_of,
    judge,
    read_rows,
)
from jaxpf.papers.maccormick1999 import claims as maccormick1999
from jaxpf.papers.paper import PAPERS


@pytest.mark.parametrize("paper", PAPERS)
def test_a_claim_has_eight_words_and_a_sentence(paper):
    claims = claims_of(paper)
    assert len(claims) > 9
    for key, claim in claims.items():
        assert len(claim.claim.split()) <= 8, key
        assert claim.sentence.endswith("."), key
        assert claim.group in GROUPS
        assert claim.source
        assert claim.at_least < claim.at_most
        if claim.margin:
            assert "ours" in claim.sentence or "Our margin" in claim.sentence


@pytest.mark.parametrize("paper", PAPERS)
def test_a_stored_verdict_says_what_it_rests_on(paper):
    stored = verdicts.stored(paper)
    assert len({each.claim.key for each in stored}) == len(stored) > 9
    for each in stored:
        assert each.command.startswith(f"jaxpf reproduce {paper}")
        assert each.version
        assert each.units == "computed" or float(each.level) >= 95
        if each.verdict == OPEN:
            assert "resolve it" in each.remark or "within our margin" in each.remark


@pytest.mark.parametrize("paper", PAPERS)
def test_a_claim_without_a_verdict_has_a_reason(paper):
    left = verdicts.not_judged(paper)
    assert len(left) > 3
    assert all(each["claim"] and each["source"] and each["reason"] for each in left)


@pytest.mark.parametrize("paper", PAPERS)
def test_chosen_settings_say_how_they_were_chosen(paper):
    rows = list(read_rows(paper, "settings.csv"))
    assert len(rows) > 3
    assert all(row["setting"] and row["value"] and row["how"] for row in rows)


@pytest.mark.parametrize(
    ("paper", "key", "figures"),
    [
        ("maccormick1999", "line", lambda: [maccormick1999.of_line()]),
        ("gonzales2011", "resamplings", gonzales2011.resamplings),
    ],
)
def test_a_computed_figure_is_stored_as_it_is_today(paper, key, figures):
    today = judge(claims_of(paper)[key], figures())
    (stored,) = (each for each in verdicts.stored(paper) if each.claim.key == key)
    assert (stored.ours, stored.verdict, stored.units) == (today.ours, SUPPORTED, "computed")


def test_the_summary_counts_the_papers_own_claims():
    stored = verdicts.stored("rowe2005")
    own = verdicts.of_group(stored, "paper")
    assert 0 < len(own) < len(stored)
    doubted = [
        own[0]._replace(verdict=CONTRADICTED),
        *(each._replace(verdict=OPEN) for each in own[1:3]),
    ]
    doubted += [each._replace(verdict=SUPPORTED) for each in own[3:5]]
    assert verdicts.summary("rowe2005", doubted) == "rowe2005: 2 of 5 hold, 1 does not, 2 open"


def test_all_papers_fit_on_two_screens():
    result = jaxpf("verdicts")
    assert result.code == 0, result.err
    lines = result.out.splitlines()
    assert len(lines) <= 100
    assert max(map(len, lines)) <= 100
    for paper in PAPERS:
        assert verdicts.summary(paper, verdicts.stored(paper)) in lines


@pytest.mark.parametrize("paper", PAPERS)
def test_details_fit_the_screen_too(paper):
    assert max(map(len, verdicts.report(paper, verdicts.stored(paper), details=True))) <= 100


def test_the_readme_quotes_the_first_lines():
    readme = (Path(__file__).parents[2] / "README.md").read_text()
    quoted = readme.split("prints stored results:\n\n```\n")[1].split("\n```")[0]
    assert quoted.splitlines() == [verdicts.summary(each, verdicts.stored(each)) for each in PAPERS]


def test_details_print_the_sentence_and_the_other_claims():
    plain, detailed = jaxpf("verdicts", "rowe2005"), jaxpf("verdicts", "rowe2005", "--details")
    assert detailed.code == 0, detailed.err
    for words in ("is our reading", "rowe2005, beyond the paper:", "rowe2005, not judged:"):
        assert words in detailed.out
        assert words not in plain.out
    assert "smith2004:" not in detailed.out


def test_an_unknown_paper_is_refused():
    result = jaxpf("verdicts", "rowe2006")
    assert result.code == 2
    assert "rowe2006" in result.err


def test_the_origin_is_that_of_most_rows():
    own = verdicts.of_group(verdicts.stored("rowe2005"), "paper")[:3]
    dated = [each._replace(units="50 scenes", level="95") for each in own]
    assert verdicts.origin(dated) == "50 scenes, 95 % intervals"
    other = dated[0]._replace(level="99")
    assert verdicts.origin([*dated, other]) == "50 scenes, 95 % intervals; 1 row otherwise"
    assert verdicts.origin([dated[0]._replace(units="computed")]) == "computed"
