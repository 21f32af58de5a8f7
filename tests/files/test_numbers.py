"""Every reader of tables takes the same numbers, separators and marks, and names decimal commas."""

import numpy as np
import pytest
from refusals import message_of

from jaxpf import InputError
from jaxpf.boxes import read_boxes
from jaxpf.contours.learning import read_annotated
from jaxpf.detections.files import read_detections
from jaxpf.parts.files import read_parts
from jaxpf.points.files import read_points

#: Reader -> the name of its file, its lines with two numbers x and y, and what it makes of them.
READERS = {
    "boxes": ("b.csv", "frame,id,x,y,w,h\n0,1,{x},{y},5,6\n", lambda p: read_boxes(p).box[0, :2]),
    "MOT": ("b.txt", "1,1,{x},{y},5,6,1,-1,-1,-1\n", lambda p: read_boxes(p).box[0, :2] + 1),
    "detections": (
        "det.txt",
        "1,-1,{x},{y},5,6,.5,-1,-1,-1\n",
        lambda p: read_detections(p).box[0, :2] + 1,
    ),
    "parts": (
        "parts.csv",
        "part,parent,x,y,w,h,angle\na,,{x},{y},5,6,0\n",
        lambda p: read_parts(p).poses[0, :2],
    ),
    "points": ("points.csv", "x,y,name\n{x},{y},a\n", lambda p: read_points(p).places[0]),
    "contours": (
        "outlines.csv",
        "frame,id,k,x,y\n0,1,0,{x},{y}\n0,1,1,9,9\n",
        lambda p: read_annotated(p.parent).lines[0, "1"][0],
    ),
}


def in_quotes(text):
    return "\n".join(",".join(f'"{field}"' for field in line.split(",")) for line in text.split())


#: What spreadsheets and people make of a table that means the same.
WRITTEN = {
    "plain": lambda text: text.encode(),
    "BOM": lambda text: text.encode("utf-8-sig"),
    "semicolons": lambda text: text.replace(",", ";").encode(),
    "BOM, semicolons": lambda text: text.replace(",", ";").encode("utf-8-sig"),
    "tabs": lambda text: text.replace(",", "\t").encode(),
    "quotes": lambda text: in_quotes(text).encode(),
    "UTF-16": lambda text: text.encode("utf-16"),
    "CR": lambda text: text.replace("\n", "\r").encode(),
    "CRLF": lambda text: text.replace("\n", "\r\n").encode(),
    "blank lines": lambda text: ("\n \n" + text + "\n  \n").encode(),
    "capitals": lambda text: text.replace("x,y", "X,Y").encode(),
    "spaces": lambda text: text.replace(",", " , ").encode(),
    "empty columns": lambda text: text.replace("\n", ",,\n").encode(),
}


@pytest.mark.parametrize("reader", READERS)
@pytest.mark.parametrize(
    ("written", "x", "y"),
    [
        *((written, "10", "20") for written in WRITTEN),
        *(("plain", x, y) for x, y in (("10.0", "2e1"), (" 10 ", "+20."))),
        ("BOM, semicolons", "1E1", "20"),
    ],
)
def test_readers_take_the_same_tables(reader, written, x, y, tmp_path):
    name, lines, read = READERS[reader]
    (tmp_path / name).write_bytes(WRITTEN[written](lines.format(x=x, y=y)))
    np.testing.assert_array_equal(read(tmp_path / name), [10, 20])


@pytest.mark.parametrize("reader", READERS)
@pytest.mark.parametrize("number", ["1_0", "0xA", "nan", "inf", "1e400", "\u221210", "1 0", "ten"])
def test_readers_refuse_what_is_no_finite_number(reader, number, tmp_path):
    name, lines, read = READERS[reader]
    (tmp_path / name).write_text(lines.format(x=number, y="20"), encoding="utf-8")
    with pytest.raises(InputError, match="not a finite number"):
        read(tmp_path / name)


@pytest.mark.parametrize("rest", ["1,-1,-1,-1", "95,-1,-1,-1", "1,0,0,0", "0.9,1.5,2.5,0"])
def test_ten_columns_of_mot_files_are_taken(rest, tmp_path):
    (tmp_path / "b.txt").write_text(f"1,1,10,5,20,5,{rest}\n")
    assert read_boxes(tmp_path / "b.txt").box[0].tolist() == [9, 4, 20, 5]


def test_invisible_letters_show_in_refusals(tmp_path):
    (tmp_path / "b.csv").write_text("frame,id,x,y,w,h\n0,1,\u200b5,6,5,6\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"'\\u200b5', which is not a finite number"):
        read_boxes(tmp_path / "b.csv")


#: Of a reader, the first line.
HEADERS = {read_boxes: b"frame,id,x,y,w,h,occ\n", read_parts: b"part,parent,x,y,w,h,angle\n"}


@pytest.mark.parametrize(
    ("read", "line", "named"),
    [
        (read_boxes, b"0,9007199254740993,1,2,3,4,0", "id is '9007199254740993'"),
        (read_boxes, b"0,1,1e300,2,3,4,0", "x is '1e300'"),
        (read_boxes, b"0,1,1,2,3,4,7e99", "occ is '7e99'"),
        (read_boxes, b"0,1," + b"9" * 2_000_000 + b",2,3,4,0", "CSV"),
        (read_boxes, b"0,1," + b"x" * 100_000 + b",2,3,4,0", "x is 'xxxx"),
        (read_parts, b"9" * 2_000_000 + b",,1,2,3,4,5", "CSV"),
        (read_parts, b"b" * 2000 + b",,1,2,3,4,5", "200 letters"),
        (read_parts, b"body,,1e99,2,3,4,5", "x is '1e99'"),
    ],
)
def test_a_line_that_nobody_meant_is_refused_by_its_number_in_a_short_sentence(
    tmp_path, read, line, named
):
    (tmp_path / "table.csv").write_bytes(HEADERS[read] + line + b"\n")
    message = message_of(read, tmp_path / "table.csv")
    assert len(message) < 400
    assert "line 2 of" in message
    assert named in message
