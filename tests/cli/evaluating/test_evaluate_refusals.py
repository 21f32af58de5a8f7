"""What ``jaxpf evaluate`` refuses, each in one sentence that says where and how to go on.

``test_option_ranges.py`` has the values out of range.
"""

import pytest
from command_line import refusal_of
from small_evaluation import COMMON
from small_sequence_folder import SMALL, write_sequence

from jaxpf.files.locking import locked

pytestmark = pytest.mark.usefixtures("started_jax")


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ("--orders 1,2,3", "the order 1,2,3 is not a permutation of the 2 object(s)"),
        ("--orders first", "--orders 'first' is not an order"),
        ("--methods sir --orders 2,1", "orders are those of ps, which is not among"),
        ("--methods dps --swaps none", "swaps are those of sps, which is not among"),
        ("--sharpness 20,many", "'20,many' is not numbers separated by commas"),
        ("-n 3.5", "'3.5' is not whole numbers separated by commas"),
        ("--noise-pixels 1,2", "'1,2' holds 2 number(s); give 3 of them"),
        ("--bands 100", "100 bands need at least 100 rows"),
        ("--runs 0", "--runs 0 must be a whole number from 1"),
        ("--scene-seed -1", "seed = -1 must be a whole number, 0 or more"),
        ("--set num_objects", "--set 'num_objects' must have the form NAME=VALUE"),
        ("--set num_objects=many", "num_objects = 'many' must be a whole number"),
        ("--ids 1", "--ids 1 chooses from a recorded sequence"),
        ("--tracks theirs", "--tracks 'theirs' must have the form NAME=VALUE"),
        ("--tracks theirs=no.csv", "no such file"),
        ("--tracks a=x.csv --tracks a=y.csv", "--tracks gives a name twice"),
        ("--baseline still --tracks still=x.csv", "a tracker cannot be called"),
        ("--baseline ,", "--baseline names none; leave it out"),
        ("--dask tcp://127.0.0.1:1 --workers 2", "--dask brings workers of its own"),
    ],
)
def test_mistakes_are_one_sentence(refuse, arguments, sentence):
    assert sentence in refuse("distracter", *SMALL, *arguments.split())


@pytest.mark.parametrize("argument", ["--tracks a={}", "--tracker {}.py:f"])
def test_a_loop_of_symbolic_links_is_refused(refuse, tmp_path_factory, argument):
    loop = tmp_path_factory.mktemp("links") / "loop"
    loop.symlink_to("loop")
    place = loop / "file"
    sentence = refuse("distracter", *SMALL, *argument.format(place).split())
    assert f"cannot read '{place}" in sentence


def test_unknown_scenes_are_refused_with_those_there_are(refuse):
    sentence = refuse("distractor")
    assert "no scene 'distractor'; did you mean 'distracter'?" in sentence
    assert "distracter" in sentence
    assert "nowhere' does not exist" in refuse("./nowhere")


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ("--ids 3,3", "cannot start with the ids [3, 3]"),
        ("--start-frame 10", "--start-frame 10 must be a whole number from 0 to 9"),
        ("--set num_objects=3", "is a recorded sequence and has no parameters"),
    ],
)
def test_choices_that_a_sequence_does_not_offer_are_refused(refuse, place, arguments, sentence):
    assert sentence in refuse(place / "two", *arguments.split())


@pytest.mark.parametrize(
    ("name", "content", "sentence"),
    [
        ("gt.csv", None, "gt.csv'; check the path"),
        ("meta.json", "{", "meta.json' describes no sequence"),
        ("0003.png", None, "0003.png"),
    ],
)
def test_a_sequence_with_something_missing_is_refused(
    refuse, tmp_path_factory, name, content, sentence
):
    folder = write_sequence(tmp_path_factory.mktemp("cut") / "two")
    (folder / name).unlink()
    if content is not None:
        (folder / name).write_text(content)
    assert sentence in refuse(folder, *COMMON)


def test_an_object_absent_in_the_start_frame_is_named(refuse, tmp_path_factory):
    folder = write_sequence(tmp_path_factory.mktemp("absent") / "two")
    rows = (folder / "gt.csv").read_text().splitlines()
    (folder / "gt.csv").write_text("\n".join(r for r in rows if not r.startswith("0,3")))
    sentence = refuse(folder, "--ids", "3,7", "--start-frame", "0")
    assert "objects are in view in the frames: 3 in 1-9; 7 in 0-9" in sentence


def test_a_folder_where_somebody_is_at_work_is_refused_before_planning(tmp_path, monkeypatch):
    monkeypatch.setattr("jaxpf.evaluation.prepare", lambda *_: 1 / 0)
    with locked(tmp_path / "out", "evaluating"):
        sentence = refusal_of("evaluate", "distracter", *SMALL, *COMMON, "-o", tmp_path / "out")
    assert "another process is evaluating into" in sentence


def test_a_dask_scheduler_that_is_not_there_is_refused(refuse):
    pytest.importorskip("distributed", reason="needs Dask: pip install jaxpf[cluster]")
    sentence = refuse("distracter", *SMALL, *COMMON, "--dask", "tcp://127.0.0.1:1")
    assert "no scheduler answers there" in sentence
