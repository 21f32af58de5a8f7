import pytest
from box_files import GT, message_of

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
    ("text", "expected"),
    [
        ("1,1,2,3,4,5\n1,2,2,3,4\n", ["line 2", "5 columns", "6 to 10", "frame,id,x,y,w,h,conf"]),
        ("1,1,2,3,4,5,1,1,1,1,1\n", ["line 1", "11 columns", "6 to 10"]),
        ("1 1 2 3 4 5\n", ["line 1", "1 columns", "frame,id,x,y,w,h,conf"]),
        (HEADER + "0,1,2,3,4,5\n", ["line 2", "6 columns", "expected 7"]),
        ("1,1,abc,3,4,5\n", ["line 1", "column 3 is 'abc'", "not a finite number"]),
        ("1,1,,3,4,5\n", ["line 1", "column 3"]),
        ("1,1,2,3,4,5\n\n1,2,2,nan,4,5\n", ["line 3", "column 4 is 'nan'", "finite"]),
        ("nan,1,2,3,4,5\n", ["line 1", "column 1 is 'nan'"]),
        ("1,1,2,3,inf,5\n", ["line 1", "column 5 is 'inf'"]),
        ("1,1,2,3,1e999,5\n", ["line 1", "column 5 is '1e999'"]),
        ("1.5,1,2,3,4,5\n", ["line 1", "frame 1.5", "whole number"]),
        ("1,1.5,2,3,4,5\n", ["line 1", "id 1.5", "whole number"]),
        ("1,1,2,3,0,5\n", ["line 1", "zero size 0 x 5", "delete the line"]),
        ("1,1,2,3,4,-5\n", ["line 1", "negative size 4 x -5", "not a second corner"]),
        ("1,1,2,5,3,4,5\n2,1,2,3,4,5\n", ["line 2", "6 columns and line 1 has 7", "a point"]),
        (HEADER + "0,1,2,3,4,5,3\n", ["line 2", "occ 3", "-1, 0, 1 or 2"]),
        (TRACKS + "0,0,1,2,3,4,5,high,0\n", ["line 2", "confidence is 'high'"]),
        (TRACKS + "0,0,1,2,3,4,5,,no\n", ["line 2", "lost is 'no'"]),
        ("1,1,2,3,4,5\n1,1,2,3,4,6\n", ["line 2", "id 1", "of line 1", "keep one"]),
        ("0,1,2,3,4,5\n", ["line 1", "frame 0", "MOT files count frames from 1"]),
        (HEADER + "-1,1,2,3,4,5,0\n", ["line 2", "frame -1", "counts frames from 0"]),
        ("", ["is empty", "frame,id,x,y,w,h,occ", "MOT"]),
        (" \n\n", ["is empty"]),
        (HEADER, ["holds no boxes", "MOT"]),
        ("x,y,w,h\n1,2,3,4\n", ["line 1", "unknown header 'x,y,w,h'", "frame,id,x,y,w,h,occ"]),
        (b"\xff\x00\x01", ["is not a text file"]),
    ],
)
def test_each_mistake_is_named_with_its_line_and_remedy(boxes_file, text, expected):
    path = boxes_file(text)
    message = message_of(read_boxes, path)
    assert f"'{path}'" in message
    for part in expected:
        assert part in message


def test_a_missing_file_and_a_folder_are_named(tmp_path):
    message = message_of(read_boxes, tmp_path / "gone.csv")
    assert f"there is no file of boxes at '{tmp_path / 'gone.csv'}'" in message
    assert f"'{tmp_path}' is a folder; give a file" in message_of(read_boxes, tmp_path)


def test_empty_boxes_can_mean_absent_but_negative_ones_never(boxes_file):
    path = boxes_file("1,1,0,0,0,0\n2,1,5,6,7,8\n")
    assert read_boxes(path, empty_boxes="absent").frame.tolist() == [1]
    path = boxes_file("1,1,0,0,-1,0\n")
    assert "negative size" in message_of(read_boxes, path, empty_boxes="absent")
    assert len(read_boxes(boxes_file("1,1,0,0,0,0\n"), empty_boxes="absent")) == 0
    with pytest.raises(ValueError, match="'error' or 'absent'"):
        read_boxes(path, empty_boxes="ignore")
