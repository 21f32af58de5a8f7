"""What ``jaxpf evaluate`` refuses, each in one sentence that says where and how to go on.

``test_option_ranges.py`` has the values out of range.
"""

import pytest
from command_line import refusal_of
from small_evaluation import COMMON
from small_sequence_folder import SMALL

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


def test_a_part_that_a_sequence_does_not_have_is_refused(refuse, place):
    """``tests/sequences/test_refusals.py`` has every such mistake."""
    assert "--start-frame 10" in refuse(place / "two", "--start-frame", "10")


def test_unknown_scenes_are_refused_with_those_there_are(refuse):
    assert "'distracter'" in refuse("distractor")
    assert "nowhere'" in refuse("./nowhere")


def test_a_folder_where_somebody_is_at_work_is_refused_before_planning(tmp_path, monkeypatch):
    monkeypatch.setattr("jaxpf.cli.evaluating.command.prepare", lambda *_: 1 / 0)
    with locked(tmp_path / "out", "evaluating"):
        sentence = refusal_of("evaluate", "distracter", *SMALL, *COMMON, "-o", tmp_path / "out")
    assert "another process is evaluating into" in sentence


def test_a_dask_scheduler_that_is_not_there_is_refused(refuse):
    pytest.importorskip("distributed", reason="needs Dask: pip install jaxpf[cluster]")
    sentence = refuse("distracter", *SMALL, *COMMON, "--dask", "tcp://127.0.0.1:1")
    assert "no scheduler answers there" in sentence
