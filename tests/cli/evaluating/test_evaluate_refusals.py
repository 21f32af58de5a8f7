"""What ``jaxpf evaluate`` refuses, each in one sentence that says where and how to go on.

``test_option_ranges.py`` has the values out of range.
"""

import pytest
from command_line import refusal_of
from small_evaluation import COMMON
from small_sequence_folder import SMALL, write_sequence

from jaxpf.files.store import locked

pytestmark = pytest.mark.usefixtures("started_jax")


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ("--orders 1,2,3", "order 1,2,3"),
        ("--orders first", "--orders 'first'"),
        ("--methods sir --orders 2,1", "orders"),
        ("--methods dps --swaps none", "swaps"),
        ("--sharpness 20,many", "'20,many'"),
        ("--noise-pixels 1,2", "'1,2'"),
        ("--set bands=100", "fewer bands"),
        ("--set num_objects", "--set 'num_objects'"),
        ("--set num_objects=many", "'many'"),
        ("--ids 1", "--ids 1"),
        ("--tracks theirs", "--tracks 'theirs'"),
        ("--tracks theirs=no.csv", "no.csv"),
        ("--tracks a=x.csv --tracks a=y.csv", "--tracks"),
        ("--baseline still --tracks still=x.csv", "cannot be called"),
        ("--baseline ,", "--baseline"),
        ("--dask tcp://127.0.0.1:1 --workers 2", "--dask"),
    ],
)
def test_mistakes_are_one_sentence(refuse, arguments, named):
    assert named in refuse("distracter", *SMALL, *arguments.split())


def test_unknown_scenes_are_refused_with_those_there_are(refuse):
    assert "'distracter'" in refuse("distractor")
    assert "nowhere'" in refuse("./nowhere")


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ("--ids 3,3", "[3, 3]"),
        ("--start-frame 10", "--start-frame 10"),
        ("--set num_objects=3", "no parameters"),
    ],
)
def test_choices_that_a_sequence_does_not_offer_are_refused(refuse, place, arguments, named):
    assert named in refuse(place / "two", *arguments.split())


@pytest.mark.parametrize(
    ("name", "content"), [("gt.csv", None), ("meta.json", "{"), ("0003.png", None)]
)
def test_a_sequence_with_something_missing_is_refused(refuse, tmp_path_factory, name, content):
    folder = write_sequence(tmp_path_factory.mktemp("cut") / "two")
    (folder / name).unlink()
    if content is not None:
        (folder / name).write_text(content)
    assert name in refuse(folder, *COMMON)


def test_an_object_absent_in_the_start_frame_is_named(refuse, tmp_path_factory):
    folder = write_sequence(tmp_path_factory.mktemp("absent") / "two")
    rows = (folder / "gt.csv").read_text().splitlines()
    (folder / "gt.csv").write_text("\n".join(r for r in rows if not r.startswith("0,3")))
    sentence = refuse(folder, "--ids", "3,7", "--start-frame", "0")
    assert "objects are in view in the frames: 3 in 1-9; 7 in 0-9" in sentence


def test_a_folder_where_somebody_is_at_work_is_refused_before_planning(tmp_path, monkeypatch):
    monkeypatch.setattr("jaxpf.cli.evaluating.command.prepare", lambda *_: 1 / 0)
    with locked(tmp_path / "out", "evaluating"):
        sentence = refusal_of("evaluate", "distracter", *SMALL, *COMMON, "-o", tmp_path / "out")
    assert "another process is evaluating into" in sentence


def test_a_dask_scheduler_that_is_not_there_is_refused(refuse):
    pytest.importorskip("distributed", reason="needs Dask: pip install jaxpf[cluster]")
    sentence = refuse("distracter", *SMALL, *COMMON, "--dask", "tcp://127.0.0.1:1")
    assert "no scheduler answers there" in sentence
