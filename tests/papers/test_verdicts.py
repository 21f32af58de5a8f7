"""The stored verdicts: whole, honest about what they leave open, and repeatable."""

import pytest
from command_line import jaxpf

from jaxpf.papers.gonzales2011 import claims as gonzales2011
from jaxpf.papers.judging import verdicts
from jaxpf.papers.judging.claims import CANNOT_RESOLVE
from jaxpf.papers.maccormick1999 import claims as maccormick1999
from jaxpf.papers.paper import PAPERS


@pytest.mark.parametrize("paper", PAPERS)
def test_every_claim_has_a_verdict_or_the_runs_that_would_give_it(paper):
    stored = verdicts.stored(paper)
    assert sum(verdicts.counted(stored).values()) == len(stored) > 3
    for claim in stored:
        assert claim["command"].startswith(f"jaxpf reproduce {paper} ")
        assert claim["version"]
        assert claim["date"]
        assert int(claim["runs"]) > 0
        if claim["verdict"] == CANNOT_RESOLVE:
            assert "resolve it" in claim["measured"]


@pytest.mark.parametrize("paper", PAPERS)
def test_what_is_not_judged_has_a_reason(paper):
    left = verdicts.not_judged(paper)
    assert len(left) > 3
    assert all(each["claim"] and each["source"] and each["reason"] for each in left)


@pytest.mark.parametrize(
    ("paper", "claim"),
    [
        ("maccormick1999", maccormick1999.line_claim),
        ("gonzales2011", lambda: gonzales2011.curve_claims({})[-1]),
    ],
)
def test_a_stored_figure_is_what_is_measured_today(paper, claim):
    """Of the claims that are computed; the others take minutes: ``jaxpf reproduce``."""
    today = claim()
    assert all(part.is_exact for part in today.parts)
    (stored,) = (each for each in verdicts.stored(paper) if each["statement"] == today.statement)
    told = stored["source"], stored["published"], stored["measured"], stored["verdict"]
    assert told == (today.source, today.published, today.measured, today.verdict)


def test_the_whole_picture_is_printed_at_once():
    result = jaxpf("verdicts")
    assert result.code == 0, result.err
    for paper in PAPERS:
        assert result.out.count(f"jaxpf reproduce {paper} ") == 1
    assert result.out.count("Not judged:") == len(PAPERS)
    one = jaxpf("verdicts", "rowe2005")
    assert one.code == 0, one.err
    assert "smith2004" not in one.out


def test_a_paper_that_is_not_there_is_refused():
    result = jaxpf("verdicts", "rowe2006")
    assert result.code == 2
    assert "rowe2006" in result.err
