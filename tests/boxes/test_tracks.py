import os
from types import SimpleNamespace

import numpy as np
from box_files import GT
from hypothesis import given, strategies as st
from properties import EVERY, tracks
from refusals import every, message_of

from jaxpf.boxes import read_boxes, target, to_supervision
from jaxpf.boxes.tracks import check_boxes, parse_box, write_mot
from jaxpf.sequences.tables import dense

VIDEO = SimpleNamespace(width=640, height=480)

# Choosing and checking


def start_boxes(table, frame, ids=None):
    return target.start_boxes(table, frame, VIDEO, ids)


def test_start_boxes_come_in_the_order_asked(boxes_file):
    table = read_boxes(boxes_file(GT))
    found = start_boxes(table, 0, [1, 3])
    assert found.ids.tolist() == [1, 3]
    assert found.shapes.tolist() == [[11.5, 21, 31, 41], [10, 20, 30, 40]]
    assert start_boxes(table, 0).ids.tolist() == [3, 1], "by default in the order of the file"


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


def test_a_typed_box_is_read():
    assert parse_box(" 1, 2.5,30 ,4e1").tolist() == [1, 2.5, 30, 40]
    assert parse_box("-5,-6,7,8").tolist() == [-5, -6, 7, 8]


def check(*boxes):
    check_boxes(boxes, VIDEO.width, VIDEO.height)


@every(
    [
        (lambda table: start_boxes(table, 1), "frame 1"),
        (lambda table: start_boxes(table, 2, [1, 3]), "id 3"),
        (lambda table: start_boxes(table, 0, [1, 3, 1]), "id 1"),
        (lambda table: dense(table, [1, 9], 4), "id 9"),
        (lambda _: parse_box("1,2,3"), "'1,2,3'"),
        (lambda _: parse_box(""), "''"),
        (lambda _: parse_box("1,2,c,4"), "'c'"),
        (lambda _: parse_box("1,2,nan,4"), "'nan'"),
        (lambda _: parse_box("1,2,3,-4"), "'1,2,3,-4' has no area"),
        (lambda _: check([1, 2, 3, 4], [np.nan, 1, 2, 3]), "object 2 (nan"),
        (lambda _: check([1, 2, 0, 3]), "object 1 (1,2,0,3)"),
        (lambda _: check([640, 2, 3, 3]), "object 1 (640"),
        (lambda _: check([2, 480, 3, 3]), "object 1 (2,480"),
        (lambda _: check([-3, 2, 3, 3]), "object 1 (-3"),
        (lambda _: check([2, -3, 3, 3]), "object 1 (2,-3"),
        (lambda _: check_boxes([[1, 2, 3, -3]], 640, 480, ["id 7"]), "id 7"),
        (lambda _: write_mot("gone/t.txt", [0], [1], [[1, 2, 3, 4]]), "'gone/t.txt'"),
    ]
)
def test_what_is_not_there_or_no_box_is_named(boxes_file, call, named):
    assert named in message_of(call, read_boxes(boxes_file(GT)))


def test_boxes_may_lie_partly_outside():
    check([-5, -5, 10, 10], [635, 475, 10, 10], [-9, -9, 999, 999])


# Writing


def test_mot_is_written_counting_from_one(tmp_path):
    path = tmp_path / "tracks.txt"
    boxes = [[0, 0, 30, 40], [10.5, 19.25, 31.12345, 4e1], [np.nan] * 4]
    write_mot(path, [0, 2, 2], [7, 8, 9], boxes, [1, 0, 1])
    assert path.read_bytes() == (
        b"1,7,1.000,1.000,30.000,40.000,1,-1,-1,-1\n3,8,11.500,20.250,31.123,40.000,0,-1,-1,-1\n"
    )
    assert os.listdir(tmp_path) == ["tracks.txt"]


@EVERY
@given(rows=tracks(st.integers(0, 2**52)))
def test_written_and_read_again_gives_the_same_numbers(tmp_path_factory, rows):
    folder = tmp_path_factory.getbasetemp()
    frames, ids, boxes, confidence = zip(*rows, strict=True)
    write_mot(folder / "one.txt", frames, ids, boxes, np.divide(confidence, 10**6))
    table = read_boxes(folder / "one.txt")
    assert (table.frame.tolist(), table.id.tolist()) == (list(frames), list(ids))
    np.testing.assert_allclose(table.box, boxes, atol=0.00051, rtol=1e-12)
    np.testing.assert_allclose(table.confidence, np.divide(confidence, 10**6), atol=1e-3)
    write_mot(folder / "two.txt", table.frame, table.id, table.box, table.confidence)
    assert (folder / "one.txt").read_bytes() == (folder / "two.txt").read_bytes()


def test_boxes_convert_to_supervisions_detections():
    boxes = [[1.0, 2, 10, 20], [np.nan] * 4, [5.0, 6, 7, 8]]
    found = to_supervision(boxes, ids=[3, 4, 9], confidence=[0.5, 0, 1])
    assert found.xyxy.tolist() == [[1, 2, 11, 22], [5, 6, 12, 14]]
    assert found.tracker_id.tolist() == [3, 9]
    assert found.confidence.tolist() == [0.5, 1]
    plain = to_supervision(boxes)
    assert plain.tracker_id.tolist() == [1, 3]
    assert plain.confidence is None
