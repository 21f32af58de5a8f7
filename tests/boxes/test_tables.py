import re

import pytest
from box_files import GT
from refusals import message_of

from jaxpf.boxes import read_boxes


def test_gt_csv_is_read_as_it_stands(boxes_file):
    table = read_boxes(boxes_file(GT))
    assert table.frame.tolist() == [0, 0, 2]
    assert table.id.tolist() == [3, 1, 1]
    assert table.box.tolist() == [[10, 20, 30, 40], [11.5, 21, 31, 41], [12, 22, 32, 42]]
    assert table.occlusion.tolist() == [0, 2, -1]
    assert table.confidence.tolist() == [1, 1, 1]
    assert len(table) == 3


def test_mot_counts_from_one_and_is_converted(boxes_file):
    table = read_boxes(boxes_file("1,7,1,1,30,40,0.5,-1,-1,-1\n3,7,11.5,21,30,40,1,-1,-1,-1\n"))
    assert table.frame.tolist() == [0, 2]
    assert table.box.tolist() == [[0, 0, 30, 40], [10.5, 20, 30, 40]]
    assert table.confidence.tolist() == [0.5, 1]
    assert table.occlusion.tolist() == [-1, -1]


@pytest.mark.parametrize(
    "text",
    [
        "1,7,2,3,30,40",
        "1,7,2,3,30,40,1\n",
        "1.0, 7, 2, 3, 30, 40, 1, 1, 0.5\r\n\r\n",
        "frame,id,x,y,w,h\n0,7,1,2,30,40\n",
        "\ufeffframe, id, x, y, w, h, OCC\r\n\r\n0,7,1,2,30,40,-1\r\n",
    ],
)
def test_harmless_variations_read_the_same(boxes_file, text):
    table = read_boxes(boxes_file(text))
    assert (table.frame.tolist(), table.id.tolist()) == ([0], [7])
    assert table.box.tolist() == [[1, 2, 30, 40]]


HEADER = "frame,id,x,y,w,h,occ\n"
TRACKS = "frame,time,id,x,y,w,h,confidence,lost\n"


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("1,1,2,3,4,5\n1,2,2,3,4\n", "line 2 .*5 columns"),
        ("1,1,2,5,3,4,5\n2,1,2,3,4,5\n", "line 2 .*6 columns"),
        (HEADER + "0,1,2,3,4,5\n", "line 2 .*6 columns"),
        ("1,1,,3,4,5\n", "line 1 .*x is ''"),
        ("1,1,2,3,4,5\n\n1,2,2,nan,4,5\n", "line 3 .*y is 'nan'"),
        ("1,1.5,2,3,4,5\n", "line 1 .*id is '1.5'"),
        ("0,1,2,3,4,5\n", "line 1 .*frame is '0'"),
        ("1,1,2,3,4,-5\n", "line 1 .*h is '-5'"),
        (HEADER + "0,1,2,3,4,5,3\n", "line 2 .*occ is '3'"),
        (TRACKS + "0,0,1,2,3,4,5,high,0\n", "line 2 .*confidence is 'high'"),
        ("1,1,2,3,4,5\n1,1,2,3,4,6\n", "line 2 .*id 1 .*line 1"),
        ("1,1,2,3,4,5,1,1,1,1,1\n", "'1,1,2.*6 to 10 columns"),
        ("x,y,w,h\n1,2,3,4\n", "'x,y,w,h'"),
        (HEADER, "no boxes"),
        (b"\xff\x00\x01", "text"),
    ],
)
def test_each_mistake_is_named_with_its_line(boxes_file, text, named):
    path = boxes_file(text)
    message = message_of(read_boxes, path)
    assert f"'{path}'" in message
    assert re.search(named, message), message


def test_a_missing_file_and_a_folder_are_named(tmp_path):
    for path in (tmp_path / "gone.csv", tmp_path):
        assert f"'{path}'" in message_of(read_boxes, path)
