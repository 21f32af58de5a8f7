"""Other trackers' files: which track belongs to which object, and where its rows go."""

import numpy as np
import pytest
from refusals import message_of

from jaxpf.boxes import read_boxes
from jaxpf.boxes.tracks import write_mot
from jaxpf.evaluation.trackers import match_tracks, read_boxes_like
from jaxpf.measures.association import pairwise_iou

IDS = [3, 5]
START = 2


@pytest.fixture
def truth():
    """Four frames of two objects, 50 pixels apart; the second is absent in the last frame."""
    boxes = np.zeros((4, 2, 4))
    boxes[..., 2:] = 20, 40
    boxes[:, 0, :2] = np.arange(4)[:, None] * [3, 1] + 10
    boxes[:, 1, :2] = np.arange(4)[:, None] * [-2, 1] + [80, 10]
    boxes[3, 1] = np.nan
    return boxes


@pytest.fixture
def written(tmp_path):
    def write(boxes, ids=IDS, start=START):
        path = tmp_path / "t.csv"
        frames = np.repeat(np.arange(len(boxes)) + start, len(ids))
        write_mot(path, frames, np.tile(ids, len(boxes)), boxes.reshape(-1, 4))
        return path

    return write


def matched(path, truth):
    return match_tracks(read_boxes(path), truth, IDS, START)


def arranged(path, truth):
    return read_boxes_like(path, truth, IDS, START)


def absent(boxes, frame, place):
    boxes = boxes.copy()
    boxes[frame, place] = np.nan
    return boxes


def moved(x, y=0):
    """What moves boxes by so many pixels."""
    return np.array([x, y, 0, 0])


#: Changes to the truth -> ids in the file, and which of them each object gets.
MATCHES = {
    "the truth itself": (lambda t: t, IDS, IDS),
    "other ids, by overlap": (lambda t: t + moved(1, -2), [71, 2], [71, 2]),
    "in another order": (lambda t: t[:, ::-1], [2, 71], [71, 2]),
    "ids that agree by chance": (lambda t: t[:, ::-1], IDS, [5, 3]),
    "an inaccurate tracker": (lambda t: t + moved(15), IDS, IDS),
    "no box at the start": (lambda t: absent(t, 0, 0), IDS, IDS),
    # Afterwards the two trackers change sides: the start frame alone decides.
    "trackers that change sides": (
        lambda t: np.concatenate([t[:1], t[1:3, ::-1], t[3:]]),
        [71, 2],
        [71, 2],
    ),
}


@pytest.mark.parametrize(("change", "ids", "expected"), MATCHES.values(), ids=MATCHES)
def test_tracks_are_matched_and_arranged_like_the_truth(written, truth, change, ids, expected):
    boxes = change(truth)
    path = written(boxes, ids)
    assert matched(path, truth) == expected
    columns = [ids.index(identity) for identity in expected]
    np.testing.assert_array_equal(arranged(path, truth), boxes[:, columns])


def test_rows_before_and_after_the_scene_and_empty_boxes_do_not_count(written, truth):
    path = written(np.concatenate([truth[:1] + 1, truth, truth[:2] + 7]), start=START - 1)
    np.testing.assert_array_equal(arranged(path, truth), truth)
    lines = path.read_text().splitlines()
    lines[4] = "4,3,12,13,0,0,1,-1,-1,-1"
    path.write_text("\n".join(lines))
    np.testing.assert_array_equal(arranged(path, truth), absent(truth, 1, 0))
    # A tracker that confirms late is matched where it begins.
    boxes = arranged(written(truth[2:], [8, 9], START + 2), truth)
    np.testing.assert_array_equal(boxes[2:], truth[2:])
    assert np.isnan(boxes[:2]).all()


def test_a_gt_csv_counts_from_0(tmp_path, truth):
    path = tmp_path / "t.csv"
    rows = [f"{t + START},5,{x},{y},{w},{h}" for t, (x, y, w, h) in enumerate(truth[:3, 1])]
    path.write_text("\n".join(["frame,id,x,y,w,h", *rows]))
    boxes = arranged(path, truth)
    np.testing.assert_array_equal(boxes[:, 1], truth[:, 1])
    assert np.isnan(boxes[:, 0]).all()


def test_the_largest_overlap_goes_first_and_each_track_once(written, truth):
    # Track 1 covers object 3 exactly, tracks 4 and 6 less; object 5 has too little of any.
    x, y, w, h = truth[0, 0]
    far = truth[0, 1] + moved(14)
    path = written(
        np.array([[[x + 3, y, w, h], [x, y, w, h], [x, y + 5, w, h], far]]), [4, 1, 6, 7]
    )
    assert matched(path, truth) == [1, None]
    assert np.isnan(arranged(path, truth)[:, 1]).all()
    truth[:, 1] = truth[:, 0] + moved(5)
    assert matched(written(truth[:, :1] + moved(2), [8]), truth) == [8, None]


def test_ids_are_trusted_beside_a_neighbour_unless_another_begins_on_the_object(written, truth):
    # Object 3's own id appears only later, where track 9 stood from the start.
    boxes = np.full((4, 3, 4), np.nan)
    boxes[:, 0], boxes[:, 1], boxes[2:, 2] = truth[:, 0], truth[:, 1], truth[2:, 0] + 300
    assert matched(written(boxes, [9, 5, 3]), truth) == [9, 5]
    # A neighbour that overlaps a little, 8 / 32, does not contradict.
    truth[:, 1, :2] = truth[:, 0, :2] + np.array([12, 0])
    assert matched(written(absent(truth, 0, 0)), truth) == IDS


@pytest.mark.parametrize(
    ("change", "ids", "start", "named"),
    [
        (lambda t: t + moved(500), [8, 9], START, ["in frame 2"]),
        # Swapped ids that fit badly, 11 / 29, are given to no object.
        (lambda t: t[:, ::-1] + moved(9), IDS, START, ["overlaps"]),
        (lambda t: t, IDS, 50, ["2 to 5", "50 to 53"]),
    ],
)
def test_a_file_of_another_scene_is_refused(written, truth, change, ids, start, named):
    message = message_of(arranged, written(change(truth), ids, start), truth)
    assert all(words in message for words in named)


def test_files_without_boxes_are_refused(tmp_path, truth):
    path = tmp_path / "t.csv"
    path.write_text("1,1,5,5,0,0,1\n")
    assert "none" in message_of(arranged, path, truth)
    assert "nowhere.csv" in message_of(arranged, path.with_name("nowhere.csv"), truth)


def test_overlaps_of_pairs_are_worked_out_by_hand():
    one = [[0, 0, 4, 2], [0, 0, 0, 5], [np.nan, 0, 1, 1]]
    other = [[2, 0, 4, 2], [0, 0, 4, 2], [4, 0, 4, 2], [1, 0, 2, 2]]
    expected = np.zeros((3, 4))
    expected[0] = 4 / 12, 1, 0, 0.5
    np.testing.assert_array_equal(pairwise_iou(one, other), expected)
    assert pairwise_iou(one, np.zeros((0, 4))).shape == (3, 0)
