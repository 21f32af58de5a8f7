import os

import numpy as np
import pytest
from box_files import GT
from refusals import message_of

from jaxpf.boxes import (
    BoxTable,
    box_model,
    check_boxes,
    dense,
    parse_box,
    read_boxes,
    relative_steps,
    start_boxes,
    to_supervision,
    write_mot,
)

# Choosing and checking


def test_start_boxes_come_in_the_order_asked(boxes_file):
    table = read_boxes(boxes_file(GT))
    ids, boxes = start_boxes(table, 0, [1, 3])
    assert ids.tolist() == [1, 3]
    assert boxes.tolist() == [[11.5, 21, 31, 41], [10, 20, 30, 40]]
    assert start_boxes(table, 0)[0].tolist() == [3, 1], "by default in the order of the file"


@pytest.mark.parametrize(
    ("frame", "ids", "expected"),
    [
        (1, None, ["no box in frame 1", "frame among 0, 2", "counting from 0"]),
        (2, [1, 3], ["id 3 has no box in frame 2", "the ids there are 1"]),
        (0, [1, 3, 1], ["id 1 has no box", "or is asked for twice"]),
        (0, [], ["no ids were asked for", "choose among 1, 3"]),
        (0.5, None, ["frame = 0.5 must be a whole number"]),
        (0, 3, ["ids=3 must be the ids"]),
    ],
)
def test_start_boxes_that_are_not_there_are_refused(boxes_file, frame, ids, expected):
    message = message_of(start_boxes, read_boxes(boxes_file(GT)), frame, ids)
    assert all(part in message for part in expected)


def test_long_lists_of_frames_are_shortened(boxes_file):
    lines = [f"{frame},1,2,3,4,5" for frame in [*range(1, 72), 80, 81, 90]]
    table = read_boxes(boxes_file("\n".join(lines)))
    assert "frame among 0-70, 79, 80, 89 (counting" in message_of(start_boxes, table, 75)
    table = read_boxes(boxes_file("\n".join(f"{frame},1,2,3,4,5" for frame in range(1, 100, 2))))
    assert "22, ... (counting from 0)" in message_of(start_boxes, table, 1)


def test_dense_has_nan_where_an_object_is_absent(boxes_file):
    table = read_boxes(boxes_file(GT))
    boxes = dense(table, [1, 3], 2)
    assert boxes.shape == (2, 2, 4)
    assert boxes[0].tolist() == [[11.5, 21, 31, 41], [10, 20, 30, 40]]
    assert np.isnan(boxes[1]).all()
    assert dense(table, [1], 4)[2, 0].tolist() == [12, 22, 32, 42]
    message = message_of(dense, table, [1, 9], 4)
    assert "id 9 does not occur in" in message
    assert "its ids are 1, 3" in message
    for count in (-1, 10**12, 2.5):
        message = message_of(dense, table, [1], count)
        assert f"num_frames = {count} must be a whole number" in message


def test_a_typed_box_is_read():
    assert parse_box(" 1, 2.5,30 ,4e1").tolist() == [1, 2.5, 30, 40]
    assert parse_box("-5,-6,7,8").tolist() == [-5, -6, 7, 8]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("1,2,3", "has 3 number(s) instead of 4"),
        ("", "has 1 number(s) instead of 4"),
        ("1,2,c,4", "holds 'c', which is not a finite number"),
        ("1,,3,4", "holds '', which is not a finite number"),
        ("1,2,nan,4", "holds 'nan', which is not a finite number"),
        ("1,2,3,-4", "size 3 x -4"),
    ],
)
def test_a_mistyped_box_is_refused(text, expected):
    message = message_of(parse_box, text)
    assert f"box '{text}'" in message
    assert expected in message
    assert "write x,y,w,h in pixels, such as 120,80,40,90" in message


@pytest.mark.parametrize(
    ("box", "expected"),
    [
        ([np.nan, 1, 2, 3], "is not finite; give four numbers"),
        ([1, 2, 0, 3], "(1,2,0,3) has no area; give a positive width"),
        ([1, 2, 3, -3], "has no area"),
        ([640, 2, 3, 3], "(640,2,3,3) lies outside the 640x480 frame; give a box that overlaps"),
        ([2, 480, 3, 3], "lies outside"),
        ([-3, 2, 3, 3], "lies outside"),
        ([2, -3, 3, 3], "lies outside"),
    ],
)
def test_unusable_boxes_are_refused(box, expected):
    # Partly outside the frame they pass.
    check_boxes([[-5, -5, 10, 10], [635, 475, 10, 10], [-9, -9, 999, 999]], 640, 480)
    message = message_of(check_boxes, [[1, 2, 3, 4], box], 640, 480)
    assert message.startswith("box 2 (")
    assert expected in message
    assert "the box of id 7 (" in message_of(check_boxes, [box], 640, 480, ["id 7"])


@pytest.mark.parametrize(
    ("call", "arguments", "expected"),
    [
        (check_boxes, ([[1, 2, 3]], 640, 480), "boxes has shape [1, 3]; give x, y, w, h"),
        (check_boxes, ([[1, 2, 3, 4]], None, 480), "width=None must be a finite number above 0"),
        (check_boxes, ([[1, 2, 3, 4]], 640, 480, "ab"), "names='ab' must be one name for each"),
        (BoxTable, ([0], [1, 2], np.ones((1, 4)), [0], [1]), "id has shape [2]; give one for"),
        (start_boxes, (None, 0), "table is NoneType: give a BoxTable"),
        (parse_box, (None,), "text is NoneType: give a str"),
        (write_mot, ("a.txt", 1, 1, [1, 2, 3, 4]), "frames=1 must be the frame of every row"),
        (write_mot, ("a.txt", [1, 2], [1], np.ones((2, 4))), "ids has shape [1]; give the id"),
        (box_model, (None, [1, 2, 3]), "boxes has shape [3]; give x, y, w, h in pixels"),
        (relative_steps, ([1, 2], 1), "noise_relative 1,2 must be three numbers for each object"),
    ],
)
def test_what_is_no_array_or_table_is_refused(call, arguments, expected):
    assert expected in message_of(call, *arguments)


# Writing


def test_mot_is_written_counting_from_one(tmp_path):
    path = tmp_path / "tracks.txt"
    boxes = [[0, 0, 30, 40], [10.5, 19.25, 31.12345, 4e1], [np.nan] * 4]
    write_mot(path, [0, 2, 2], [7, 8, 9], boxes, [1, 0, 1])
    assert path.read_bytes() == (
        b"1,7,1.000,1.000,30.000,40.000,1,-1,-1,-1\n3,8,11.500,20.250,31.123,40.000,0,-1,-1,-1\n"
    )
    assert os.listdir(tmp_path) == ["tracks.txt"]


def test_written_and_read_again_gives_the_same_numbers(tmp_path):
    path = tmp_path / "tracks.txt"
    rng = np.random.default_rng(0)
    frames, ids = np.repeat(np.arange(50), 2), np.tile([4, 9], 50)
    boxes = np.round(rng.uniform(1, 900, (100, 4)), 3) - [[300, 300, 0, 0]]
    confidence = rng.integers(0, 2, 100)
    write_mot(path, frames, ids, boxes, confidence)
    table = read_boxes(path)
    np.testing.assert_array_equal(table.frame, frames)
    np.testing.assert_array_equal(table.id, ids)
    np.testing.assert_allclose(table.box, boxes, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(table.confidence, confidence)
    again = tmp_path / "again.txt"
    write_mot(again, table.frame, table.id, table.box, table.confidence)
    assert again.read_bytes() == path.read_bytes()


def test_places_that_cannot_be_written_are_named(tmp_path):
    path = tmp_path / "gone" / "tracks.txt"
    message = message_of(write_mot, path, [0], [1], [[1, 2, 3, 4]])
    assert f"cannot write '{path}': no such file or directory; check the path" in message


def test_boxes_convert_to_supervisions_detections():
    boxes = [[1.0, 2, 10, 20], [np.nan] * 4, [5.0, 6, 7, 8]]
    found = to_supervision(boxes, ids=[3, 4, 9], confidence=[0.5, 0, 1])
    assert found.xyxy.tolist() == [[1, 2, 11, 22], [5, 6, 12, 14]]
    assert found.tracker_id.tolist() == [3, 9]
    assert found.confidence.tolist() == [0.5, 1]
    plain = to_supervision(boxes)
    assert plain.tracker_id.tolist() == [1, 3]
    assert plain.confidence is None
