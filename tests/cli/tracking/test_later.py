"""Objects that a start file names in later frames."""

import json
import shutil

import numpy as np
import pytest
from clips import write_starts, write_table
from command_line import jaxpf, started_by_track
from small_video import LENGTH, true_boxes

from jaxpf.boxes import read_tracks


def rows_of(output, name):
    table = read_tracks(output / "tracks.csv")
    return {key: values[table["id"] == name] for key, values in table.items()}


@pytest.mark.slow
@pytest.mark.always
def test_an_object_starts_later_and_another_is_put_right(track, tmp_path):
    wrong, (left, right) = [30, 30, 12, 16], true_boxes(4)  # wrong: background
    rows = ((0, 1, true_boxes(0)[0]), (0, 3, wrong), (4, 2, left), (4, 3, right))
    outcome = track("--boxes", write_starts(tmp_path / "starts.csv", *rows))
    assert outcome.code == 0, outcome.err
    output = tmp_path / "out"
    one, two, three = (rows_of(output, name) for name in (1, 2, 3))
    for rows, first in ((one, 0), (two, 4), (three, 0)):
        np.testing.assert_array_equal(rows["frame"], np.arange(first, LENGTH))
    # Where a start is given it is the track, without an interval.
    assert [three[key][4] for key in "xywh"] == list(right)
    assert np.isnan(three["x_2.5"][4])
    assert np.isfinite(three["x_2.5"][[3, 5]]).all()
    truth = np.array([true_boxes(time) for time in range(LENGTH)])
    for rows, index, begin in ((one, 0, 1), (two, 0, 5), (three, 1, 5)):
        times = rows["frame"][rows["frame"] >= begin]
        x = rows["x"][rows["frame"] >= begin]
        assert np.abs(x - truth[times, index, 0]).max() < 4
    columns = (output / "diagnostics.csv").read_text().splitlines()[0].split(",")
    confidences = [name for name in columns if name.startswith("confidence")]
    assert confidences == [f"confidence_{name}" for name in (1, 3, 2)]


@pytest.mark.slow
def test_the_start_frames_objects_are_tracked_as_without_later_ones(track, tmp_path):
    starts = [(0, 1, true_boxes(0)[0]), (0, 2, true_boxes(0)[1])]
    assert track("--boxes", write_starts(tmp_path / "a.csv", *starts)).code == 0
    alone = (tmp_path / "out" / "tracks.csv").read_text().splitlines()
    later = (7, 2, true_boxes(7)[1] + [1, 0, 0, 0])
    outcome = track(
        "--boxes", write_starts(tmp_path / "b.csv", *starts, later), "-o", tmp_path / "b"
    )
    assert outcome.code == 0, outcome.err
    rows = (tmp_path / "b" / "tracks.csv").read_text().splitlines()
    assert rows[: 1 + 2 * 7] == alone[: 1 + 2 * 7]
    of_first = [row for row in rows if row.split(",")[2] == "1"]
    assert of_first == [row for row in alone if row.split(",")[2] == "1"]


def test_a_file_of_whole_tracks_starts_objects_once(track, tmp_path, place):
    outcome = track("--boxes", place / "gt.csv", "--frames", 2, "--no-overlay")
    assert outcome.code == 0, outcome.err
    assert "the start file holds whole tracks; only its frame 0 is used" in outcome.err
    assert np.isfinite(rows_of(tmp_path / "out", 1)["x_2.5"][1:]).all()


def test_options_of_one_tracker_are_refused_with_later_starts(refuse, tmp_path):
    rows = ((0, 1, true_boxes(0)[0]), (4, 2, true_boxes(4)[1]))
    starts = write_starts(tmp_path / "starts.csv", *rows)
    assert "--runs does not work with objects that start in a later frame" in refuse(
        "--boxes", starts, "--runs", 2
    )


QUICKLY = ("--method", "sir", "-n", 20, "--no-overlay")


@pytest.mark.slow
@pytest.mark.always
def test_a_frame_counts_for_an_object_that_was_tracked_into_it(track, tmp_path, place):
    """Not those before its start, nor those in which its box was given."""
    rows = [(0, 1), (4, 2), (6, 1), (6, 2)]
    given = ((frame, name, true_boxes(frame)[name - 1]) for frame, name in rows)
    starts = write_starts(tmp_path / "starts.csv", *given)
    outcome = track(
        *("--boxes", starts, "--ids", "1,2", "--truth", place / "gt.csv", "--frames", 8, *QUICKLY)
    )
    assert outcome.code == 0, outcome.err
    first, second = (tmp_path / "out" / "metrics.csv").read_text().splitlines()[1:]
    assert first.split(",")[:2] == ["1", "7"]
    assert second.split(",")[:2] == ["2", "3"]


@pytest.mark.slow
def test_truth_of_an_object_that_starts_later_is_enough(track, tmp_path, place):
    header, *lines = (place / "gt.csv").read_text().splitlines()
    of_second = [line for line in lines if line.split(",")[1] == "2"]
    (tmp_path / "truth.csv").write_text("\n".join([header, *of_second]))
    starts = write_starts(tmp_path / "s.csv", (0, 1, true_boxes(0)[0]), (2, 2, true_boxes(2)[1]))
    outcome = track("--boxes", starts, "--truth", tmp_path / "truth.csv", "--frames", 4, *QUICKLY)
    assert outcome.code == 0, outcome.err


@pytest.mark.slow
def test_the_only_object_may_be_put_right_and_is_exported(track, tmp_path):
    rows = ((frame, 1, true_boxes(frame)[0]) for frame in (0, 3, 9))
    outcome = track("--boxes", write_starts(tmp_path / "s.csv", *rows), "--frames", 5, *QUICKLY)
    assert outcome.code == 0, outcome.err
    assert "names in frame 9 comes after --frames" in outcome.err
    out = tmp_path / "out"
    assert jaxpf("export", out, "coco", tmp_path / "t.json").code == 0
    summary = json.loads((out / "summary.json").read_text())
    assert (len(summary["times"]), rows_of(out, 1)["frame"].tolist()) == (6, [*range(6)])


def test_a_sequences_folder_names_the_start(tmp_path, place, capsys):
    shutil.copytree(place / "images", tmp_path / "img")
    lines = (",".join(map(str, true_boxes(time)[0])) for time in range(LENGTH))
    (tmp_path / "groundtruth_rect.txt").write_text("\n".join(lines))
    start = started_by_track("boxes", place / "clip.avi", "--boxes", tmp_path)
    assert "holds whole tracks" in capsys.readouterr().err
    assert start.ids.tolist() == [1]
    np.testing.assert_array_equal(start.shapes, true_boxes(0)[:1] - [1, 1, 0, 0])


def test_ids_without_a_start_are_refused(refuse, tmp_path, place):
    starts = write_starts(tmp_path / "s.csv", (0, 1, true_boxes(0)[0]), (2, 2, true_boxes(2)[1]))
    assert "id 3 has no box in frame 0" in refuse("--boxes", starts, "--ids", "1,3")
    lines = [line for line in (place / "gt.csv").read_text().splitlines() if line[:4] != "0,2,"]
    (tmp_path / "whole.csv").write_text("\n".join(lines))
    sentence = refuse("--boxes", tmp_path / "whole.csv", "--ids", "1,2")
    assert "id 2 has no box in frame 0" in sentence
    assert "holds whole tracks" in sentence


def test_a_start_after_the_last_frame_is_an_error_and_the_tracks_are_kept(track, tmp_path):
    first, second = true_boxes(0)
    rows = ((0, 1, first), (0, 2, second), (99, 2, [1, 2, 9, 9]))
    outcome = track("--boxes", write_starts(tmp_path / "s.csv", *rows))
    assert outcome.code == 2
    assert f"has a row for frame 99, but the last frame is {LENGTH - 1}" in outcome.err
    assert rows_of(tmp_path / "out", 1)["frame"][-1] == LENGTH - 1


@pytest.mark.slow
def test_points_name_their_frames(tmp_path, place):
    rows = ((0, "<b>", (12, 16)), (5, "$x$", (41, 25)))
    starts = write_table(tmp_path / "points.csv", "frame,id,x,y", *rows)
    arguments = ("track", "points", place / "clip.avi", "-n", 60, "--points", starts)
    outcome = jaxpf(*arguments, "-o", tmp_path / "out")
    assert outcome.code == 0, outcome.err
    np.testing.assert_array_equal(rows_of(tmp_path / "out", "$x$")["frame"], np.arange(5, LENGTH))
    outcome = jaxpf(*arguments, "--start", 3, "-o", tmp_path / "none")
    assert outcome.code == 2
    assert "no point is given for frame 3; the first is in frame 0" in outcome.err
