"""``jaxpf track --detections``: objects that come and go, and what is refused."""

import numpy as np
import pytest
from command_line import jaxpf
from small_video import LENGTH, rows_of, summary_of, true_boxes

from jaxpf.boxes import read_tracks
from jaxpf.detections.files import write_detections

#: As in the run that others look at: one size of the filter.
RULES = ("--min-hits", "2", "--capacity", "2")
#: An id that is no length of an array.
LARGE = 9_000_000_000


def test_objects_start_by_detections_and_the_run_can_be_repeated(run_of, tmp_path):
    outcome, output = run_of("detected")
    assert "2 objects came, 0 went" in outcome.out
    rows = rows_of(output)
    assert set(rows[:, 1]) == {1, 2}
    for identity in (1, 2):
        own = rows[rows[:, 1] == identity]
        assert own[:, 0].tolist() == list(range(1, LENGTH))
        truth = [true_boxes(int(frame))[identity - 1] for frame in own[:, 0]]
        assert np.abs(own[:, 2:6] - truth).max() < 4
    table = read_tracks(output / "tracks.csv")
    for name in "xywh":
        low, high = table[f"{name}_2.5"], table[f"{name}_97.5"]
        assert np.nanmax(high - low) < 40
        assert np.mean((low <= table[name] + 1e-3) & (table[name] <= high + 1e-3)) > 0.7
    summary = summary_of(output)
    assert [new["frame"] for new in summary["started"]] == [1, 1]
    assert (summary["ended"], summary["refused"]) == ([], [])
    assert summary["parameters"]["method"] == "labelled"
    header = (output / "diagnostics.csv").read_text().splitlines()[0]
    assert header.endswith(",".join(f"distinct_share_slot_{i}" for i in (1, 2)))
    assert (output / "overlay.mp4").stat().st_size > 0
    again = jaxpf(
        "track", "--config", output / "run.toml", "--no-overlay", "-o", tmp_path / "again"
    )
    assert again.code == 0, again.err
    np.testing.assert_array_equal(rows_of(tmp_path / "again"), rows)


def test_start_boxes_and_named_ones_keep_their_numbers_and_scores_judge_all(track, tmp_path, place):
    pytest.importorskip("trackeval")
    x, y, w, h = true_boxes(4)[1] + [1, 1, 0, 0]
    (tmp_path / "later.txt").write_text(f"5,{LARGE},{x},{y},{w},{h}\n")
    start = ("--box", "6,8,12,16", "--detections", tmp_path / "later.txt", "--capacity", "2")
    outcome = track(*start, "--truth", place / "gt.csv")
    assert outcome.code == 0, outcome.err
    rows = rows_of(tmp_path / "out")
    assert rows[rows[:, 1] == 1][0, 0] == 0
    assert rows[rows[:, 1] == LARGE][0, 0] == 4
    assert "HOTA" in outcome.out
    header, scores = (tmp_path / "out" / "metrics.csv").read_text().splitlines()
    scores = dict(zip(header.split(","), map(float, scores.split(",")), strict=True))
    assert scores["IDSW"] == 0
    assert scores["FN"] == 3  # object 2 in frames 1 to 3, before it was named


def test_who_finds_no_place_is_told(track, tmp_path):
    third = [[2, 30, 12, 16]]
    detections = [np.vstack([true_boxes(time), third]).astype(float) for time in range(LENGTH)]
    write_detections(tmp_path / "det.txt", detections)
    outcome = track("--detections", tmp_path / "det.txt", *RULES, "--no-overlay")
    assert outcome.code == 0
    said = "Refused: 1 that could not start, first in frame 1: all places, 2, are taken"
    assert said in outcome.err
    (refused,) = summary_of(tmp_path / "out")["refused"]
    assert refused["frame"] == 1


def test_when_nobody_comes_the_reason_is_said(track, tmp_path):
    detections = [true_boxes(0).astype(float)] + [np.zeros((0, 4))] * (LENGTH - 1)
    write_detections(tmp_path / "det.txt", detections)
    outcome = track("--detections", tmp_path / "det.txt", *RULES)
    assert outcome.code == 0, outcome.err
    assert "0 objects came" in outcome.out
    assert "effective sample size" not in outcome.out
    assert "must be detected 2 times, and" in outcome.err
    assert "has detections in 1 of the frames from 0 on; lower --min-hits" in outcome.err


BOX = "--box 6,8,12,16"
ONCE = "1,-1,1,1,9,9,1\n"


@pytest.mark.parametrize(
    ("content", "arguments", "named"),
    [
        ("1,-1,1,1,9\n", "", "d.txt"),
        ("11,-1,1,1,9,9,1\n", "", "frame 10"),
        ("1,7,70,1,9,9\n", "", "frame 0"),
        ("1,7,1,1,9,9\n", "--start 2", "object 7"),
        ("2,1,1,1,9,9\n", BOX, "object 1"),
        ("2,7,1,1,9,9\n", f"{BOX} {BOX} --capacity 1", "capacity of 1"),
        (ONCE, "-n 15", "--num-particles 15"),
        (ONCE, "--method dps", "--method labelled"),
        (ONCE, "--set weights=plain", "equal share"),
        (ONCE, "--detection-confidence 2", "--detection-confidence 2"),
        (ONCE, "--tracker a.py:f", "--detections"),
    ],
)
def test_what_does_not_go_is_refused(refuse, tmp_path, content, arguments, named):
    (tmp_path / "d.txt").write_text(content)
    assert named in refuse("--detections", "d.txt", *arguments.split())
