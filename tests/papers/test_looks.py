"""Looking at a paper's claims with twice the runs each time, until every one is resolved."""

import csv

import numpy as np
import pytest
from command_line import jaxpf

from jaxpf import __version__ as version
from jaxpf.papers import paper
from jaxpf.papers.judging.claims import CANNOT_RESOLVE, SUPPORTS, judged
from jaxpf.papers.judging.estimates import mean_of
from jaxpf.papers.measuring import checkpoints

measured = []


def of_seed(seed):
    measured.append(seed)
    return {"gain": np.random.default_rng(seed).normal(0.4)}


def a_paper():
    def measure(request):
        return np.array(
            [
                checkpoints.part(f"seed-{seed}", lambda s=seed: of_seed(s))["gain"]
                for seed in request.seeds
            ]
        )

    def claims(gains):
        return [judged("a gain", "1", "some", mean_of(gains, at_least=0))]

    nothing = {"tables": lambda found: [], "figures": lambda found: {}, "read": lambda *_: None}
    return paper.Paper(
        "smith2004", "a title", 10, 4, 2, measure, claims=claims, notes=["a note"],
        without_clips="no clips", **nothing,
    )  # fmt: skip


def looked(one, folder, minutes):
    lines = []
    with checkpoints.keeping(folder, {}, for_good=True):
        *_, last = paper.until_resolved(one, one.request(report=lines.append), minutes)
    return last, lines


def test_runs_are_doubled_until_a_claim_is_resolved(tmp_path):
    measured.clear()
    comparison, lines = looked(a_paper(), tmp_path, 60)
    (claim,) = comparison.claims
    assert claim.verdict == SUPPORTS
    runs = [10 * 2**k for k in range(len(lines))]
    assert len(lines) > 2
    assert lines[0] == "Look 1: 10 runs, 1 of 1 claims open"
    assert lines[-1] == f"Look {len(lines)}: {runs[-1]} runs, 0 of 1 claims open"
    assert comparison.settings["runs"] == runs[-1]
    assert f"Look {len(lines)}, at {runs[-1]} runs" in comparison.notes[1]
    # What a look has measured is not measured again, by the next or by another call.
    assert measured == list(range(runs[-1] // 2))
    measured.clear()
    again, _ = looked(a_paper(), tmp_path, 60)
    assert measured == []
    assert again.claims[0][:5] == claim[:5]


def test_it_ends_where_time_does_or_nothing_would_resolve(tmp_path):
    comparison, lines = looked(a_paper(), tmp_path, 1e-9)
    assert len(lines) == 1
    assert comparison.claims[0].verdict == CANNOT_RESOLVE
    assert "runs would resolve it" in comparison.claims[0].measured


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        (("--until-resolved", "--quick"), "leave out --runs, --quick and --calibrate"),
        (("--until-resolved", "--runs", "10"), "leave out --runs, --quick and --calibrate"),
        (("--minutes", "3"), "--minutes is about --until-resolved, which was not given"),
        (("--until-resolved", "--minutes", "0"), "0"),
        (("--until-resolved", "--minutes", "nan"), "--minutes nan must be a number above 0"),
    ],
)
def test_what_does_not_go_together_is_refused(asked, words):
    result = jaxpf("reproduce", "smith2004", *asked)
    assert result.code == 2
    assert words in result.err


def test_the_command_leaves_what_goes_on(tmp_path, monkeypatch):
    monkeypatch.setattr(paper, "paper_of", lambda name: a_paper())
    folder = tmp_path / "out"
    asked = ("reproduce", "smith2004", "--until-resolved", "-o", str(folder))
    first = jaxpf(*asked)
    assert first.code == 0, first.err
    assert "claims open" in first.out
    (claim,) = csv.DictReader((folder / "claims.csv").read_text().splitlines())
    assert claim["verdict"] == SUPPORTS
    assert claim["command"] == "jaxpf reproduce smith2004 --until-resolved"
    assert claim["version"] == version
    assert "until_resolved = true" in (folder / "run.toml").read_text()
    measured.clear()
    again = jaxpf(*asked)
    assert again.code == 0, again.err
    assert "Going on with" in again.out
    assert measured == []
