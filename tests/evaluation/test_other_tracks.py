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
def write(tmp_path):
    def write(boxes, ids=IDS, start=START):
        path = tmp_path / "t.csv"
        frames = np.repeat(np.arange(len(boxes)) + start, len(ids))
        write_mot(path, frames, np.tile(ids, len(boxes)), boxes.reshape(-1, 4))
        return path

    return write


def shifted(x, y=0):
    """What moves boxes by so many pixels."""
    return np.array([x, y, 0, 0])


def complaint_of(path, truth):
    return message_of(read_boxes_like, path, truth, IDS, START)


def matched(path, truth):
    return match_tracks(read_boxes(path), truth, IDS, START)


def test_a_perfect_tracker_is_the_truth_also_if_it_tracks_longer(write, truth):
    np.testing.assert_array_equal(read_boxes_like(write(truth), truth, IDS, START), truth)
    path = write(np.concatenate([truth[:1] + 1, truth, truth[:2] + 7]), start=START - 1)
    np.testing.assert_array_equal(read_boxes_like(path, truth, IDS, START), truth)


def test_a_gt_csv_counts_from_0(tmp_path, truth):
    path = tmp_path / "t.csv"
    rows = [f"{t + START},5,{x},{y},{w},{h}" for t, (x, y, w, h) in enumerate(truth[:3, 1])]
    path.write_text("\n".join(["frame,id,x,y,w,h", *rows]))
    boxes = read_boxes_like(path, truth, IDS, START)
    np.testing.assert_array_equal(boxes[:, 1], truth[:, 1])
    assert np.isnan(boxes[:, 0]).all()


def test_other_ids_are_assigned_by_overlap_in_the_start_frame(write, truth):
    # Afterwards the two trackers change sides: the start frame alone decides.
    boxes = truth + shifted(1, -2)
    boxes[1:3] = boxes[1:3, ::-1]
    for given, ids in ((boxes, [71, 2]), (boxes[:, ::-1], [2, 71])):
        path = write(given, [71, 2])
        assert matched(path, truth) == ids
        np.testing.assert_array_equal(read_boxes_like(path, truth, IDS, START), boxes)


def test_ids_that_agree_by_chance_are_not_trusted(write, truth):
    path = write(truth[:, ::-1])
    assert matched(path, truth) == [5, 3]
    np.testing.assert_array_equal(read_boxes_like(path, truth, IDS, START), truth)


def test_an_inaccurate_tracker_and_one_without_a_box_at_the_start_keep_their_ids(write, truth):
    assert matched(write(truth + shifted(15)), truth) == IDS
    boxes = truth.copy()
    boxes[0, 0] = np.nan
    path = write(boxes)
    assert matched(path, truth) == IDS
    np.testing.assert_array_equal(read_boxes_like(path, truth, IDS, START), boxes)
    # Also beside a neighbour that overlaps a little: 8 / 32.
    truth[:, 1, :2] = truth[:, 0, :2] + np.array([12, 0])
    boxes = truth.copy()
    boxes[0, 0] = np.nan
    assert matched(write(boxes), truth) == IDS


def test_a_tracker_that_confirms_late_is_matched_where_it_begins(write, truth):
    boxes = read_boxes_like(write(truth[2:], [8, 9], START + 2), truth, IDS, START)
    assert np.isnan(boxes[:2]).all()
    np.testing.assert_array_equal(boxes[2:], truth[2:])


def test_the_largest_overlap_goes_first_and_each_track_once(write, truth):
    # Track 1 covers object 3 exactly, tracks 4 and 6 less; object 5 has too little of any.
    x, y, w, h = truth[0, 0]
    far = truth[0, 1] + shifted(14)
    boxes = np.array([[[x + 3, y, w, h], [x, y, w, h], [x, y + 5, w, h], far]])
    path = write(boxes, [4, 1, 6, 7])
    assert matched(path, truth) == [1, None]
    assert np.isnan(read_boxes_like(path, truth, IDS, START)[:, 1]).all()
    truth[:, 1] = truth[:, 0] + shifted(5)
    assert matched(write(truth[:, :1] + shifted(2), [8]), truth) == [8, None]


def test_an_empty_box_is_an_absent_one(write, truth):
    path = write(truth)
    lines = path.read_text().splitlines()
    lines[2] = "4,3,12,13,0,0,1,-1,-1,-1"
    path.write_text("\n".join(lines))
    boxes = read_boxes_like(path, truth, IDS, START)
    assert np.isnan(boxes[1, 0]).all()
    np.testing.assert_array_equal(np.delete(boxes, 1, axis=0), np.delete(truth, 1, axis=0))


def test_a_file_of_another_scene_is_refused(write, truth):
    assert "in frame 2" in complaint_of(write(truth + shifted(500), [8, 9]), truth)
    # Swapped ids that fit badly, 11 / 29, are given to no object.
    assert "overlaps" in complaint_of(write(truth[:, ::-1] + shifted(9)), truth)
    path = write(truth, start=50)
    message = complaint_of(path, truth)
    assert "2 to 5" in message
    assert "50 to 53" in message
    path.write_text("1,1,5,5,0,0,1\n")
    assert "none" in complaint_of(path, truth)
    assert "nowhere.csv" in complaint_of(path.with_name("nowhere.csv"), truth)


def test_overlaps_of_pairs_are_worked_out_by_hand():
    one = [[0, 0, 4, 2], [0, 0, 0, 5], [np.nan, 0, 1, 1]]
    other = [[2, 0, 4, 2], [0, 0, 4, 2], [4, 0, 4, 2], [1, 0, 2, 2]]
    expected = np.zeros((3, 4))
    expected[0] = 4 / 12, 1, 0, 0.5
    np.testing.assert_array_equal(pairwise_iou(one, other), expected)
    assert pairwise_iou(one, np.zeros((0, 4))).shape == (3, 0)


def test_ids_are_not_trusted_when_another_begins_on_the_object(write, truth):
    # Object 3's own id appears only later, where track 9 stood from the start.
    boxes = np.full((4, 3, 4), np.nan)
    boxes[:, 0], boxes[:, 1], boxes[2:, 2] = truth[:, 0], truth[:, 1], truth[2:, 0] + 300
    assert matched(write(boxes, [9, 5, 3]), truth) == [9, 5]
