"""What ``jaxpf evaluate`` refuses, each in one sentence that says where and how to go on."""

import pytest
from command_line import jaxpf
from small_evaluation import COMMON
from small_sequence_folder import SMALL, write_sequence

from jaxpf.files.locking import locked

pytestmark = pytest.mark.usefixtures("started_jax")


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (("--baseline", "best"), "baseline 'best' is unknown; choose from mil"),
        (("--baseline", "still", "--tracks", "still={theirs}"), "a tracker cannot be called"),
    ],
)
def test_a_baseline_that_cannot_be_is_one_sentence(place, tmp_path, options, sentence):
    options = [text.format(theirs=place / "theirs.csv") for text in options]
    outcome = jaxpf("evaluate", place / "two", *COMMON, *options, "-o", tmp_path / "out")
    assert outcome.code == 2
    assert sentence in outcome.err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("--methods", "sir,pso"), "method 'pso' is unknown; choose one of sir, ps, dps, sps"),
        (("--methods", ""), "methods is empty"),
        (("--orders", "1,2,3"), "the order 1,2,3 is not a permutation of the 2 object(s)"),
        (("--orders", "first"), "--orders 'first' is no order"),
        (("--methods", "sir", "--orders", "2,1"), "orders are those of ps, which is not among"),
        (("--methods", "dps", "--swaps", "none"), "swaps are those of sps, which is not among"),
        (("--swaps", "shuffle"), "--swaps 'shuffle' is unknown"),
        (("--sharpness", "20,-1"), "--sharpness -1 must be a finite number above 0"),
        (("--sharpness", "20,many"), "'20,many' is not numbers separated by commas"),
        (("--sharpness", "20,20"), "--sharpness names 20 twice"),
        (("-n", "0"), "--particles 0 must be a whole number from 1"),
        (("-n", "1"), "--particles 1 is fewer than the 2 components of dps"),
        (("-n", "3.5"), "'3.5' is not whole numbers separated by commas"),
        (("--scale", "1,2"), "'1,2' holds 2 number(s); give 3 of them"),
        (("--scale", "1,2,-3"), "--scale 1,2,-3 must be three finite numbers"),
        (("--resampling", "bootstrap"), "--resampling 'bootstrap' is unknown"),
        (("--parts", "0"), "--bands 0 must be a whole number from 1"),
        (("--parts", "100"), "100 parts need at least 100 rows"),
        (("--likelihood", "exact"), "--likelihood 'exact' is unknown"),
        (("--runs", "0"), "--runs 0 must be a whole number from 1"),
        (("--seed", "-1"), "--seed -1 must be a whole number from 0"),
        (("--scene-seed", "-1"), "seed = -1 must be a whole number, 0 or more"),
        (("--set", "num_objects"), "--set 'num_objects' must have the form NAME=VALUE"),
        (("--set", "nobjects=3"), "no parameter 'nobjects'"),
        (("--set", "num_objects=many"), "num_objects = 'many' must be a whole number"),
        (("--ids", "1"), "--ids 1 chooses from a recorded sequence"),
        (("--workers", "0"), "--workers 0 must be a whole number from 1 to 256"),
        (("--devices", "0"), "--devices 0 must be a whole number from 1 to 256"),
        (("--memory", "0"), "--memory 0 must be a whole number from 1 to 1073741824"),
        (("--tracks", "theirs"), "--tracks 'theirs' must have the form NAME=VALUE"),
        (("--tracks", "theirs=no.csv"), "no such file"),
        (("--tracks", "a=x.csv", "--tracks", "a=y.csv"), "--tracks gives a name twice"),
        (("--tracks", "ps=x.csv"), "a tracker cannot be called 'ps'"),
        (("--baseline", ""), "--baseline names none; leave it out"),
        (("--dask", "tcp://127.0.0.1:1", "--workers", "2"), "--dask brings workers of its own"),
    ],
)
def test_mistakes_are_one_sentence(refuse, arguments, sentence):
    assert sentence in refuse("distracter", *SMALL, *arguments)


def test_a_folder_where_somebody_is_at_work_is_refused_before_planning(tmp_path, monkeypatch):
    monkeypatch.setattr("jaxpf.evaluation.prepare", lambda *_: 1 / 0)
    with locked(tmp_path / "out", "evaluating"):
        outcome = jaxpf("evaluate", "distracter", *SMALL, *COMMON, "-o", tmp_path / "out")
    assert outcome.code == 2
    assert "another process is evaluating into" in outcome.err


def test_a_dask_scheduler_that_is_not_there_is_refused(tmp_path):
    pytest.importorskip("distributed", reason="needs Dask: pip install jaxpf[cluster]")
    there = ("--dask", "tcp://127.0.0.1:1", "-o", tmp_path / "out")
    outcome = jaxpf("evaluate", "distracter", *SMALL, *COMMON, *there)
    assert outcome.code == 2
    assert "no scheduler answers there" in outcome.err


def test_unknown_scenes_are_refused_with_those_there_are(refuse):
    sentence = refuse("distractor")
    assert "no scene 'distractor'" in sentence
    assert "distracter" in sentence
    assert "nowhere' does not exist" in refuse("./nowhere")


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"gt.csv": None}, "gt.csv'; check the path"),
        ({"meta.json": "{"}, "meta.json' describes no sequence"),
        ({"0003.png": None}, "0003.png"),
    ],
)
def test_a_sequence_with_something_missing_is_refused(place, tmp_path, change, sentence):
    folder = write_sequence(tmp_path / "two")
    for name, content in change.items():
        (folder / name).unlink()
        if content is not None:
            (folder / name).write_text(content)
    outcome = jaxpf("evaluate", folder, *COMMON, "-o", tmp_path / "out")
    assert outcome.code == 2
    assert sentence in outcome.err.strip().splitlines()[-1]
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("--ids", "3,4"), "cannot start with the ids [3, 4]; name each once, among 3, 7"),
        (("--ids", "3,3"), "cannot start with the ids [3, 3]"),
        (("--start-frame", "10"), "--start-frame 10 must be a whole number from 0 to 9"),
        (("--frames", "11"), "11 must be a whole number from 1 to 10"),
        (("--frames", "1"), "has 1 frame(s)"),
        (("--set", "num_objects=3"), "is a recorded sequence and has no parameters"),
    ],
)
def test_choices_that_a_sequence_does_not_offer_are_refused(refuse, place, arguments, sentence):
    assert sentence in refuse(place / "two", *arguments)


def test_an_object_absent_in_the_start_frame_is_named(place, tmp_path):
    folder = write_sequence(tmp_path / "two")
    rows = (folder / "gt.csv").read_text().splitlines()
    (folder / "gt.csv").write_text("\n".join(r for r in rows if not r.startswith("0,3")))
    outcome = jaxpf(
        "evaluate", folder, "--ids", "3,7", "--start-frame", "0", "-o", tmp_path / "out"
    )
    assert outcome.code == 2
    assert "objects are in view in the frames: 3 in 1-9; 7 in 0-9" in outcome.err
