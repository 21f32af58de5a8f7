"""Tables that nobody meant to write: one short sentence that names the line."""

import json

import pytest
from refusals import message_of

from jaxpf.boxes import read_boxes
from jaxpf.parts.files import read_parts
from jaxpf.sequences import open_sequence

BOXES = read_boxes, b"frame,id,x,y,w,h,occ\n"
PARTS = read_parts, b"part,parent,x,y,w,h,angle\n"
LONG = b"9" * 2_000_000
META = {"name": "a", "frames": "%d.png", "n_frames": 1, "width": 4, "height": 4, "fps": 1}


def sentence(call, path):
    """The refusal: one line, and short whatever the file holds."""
    message = message_of(call, path)
    assert len(message) < 400
    return message


@pytest.mark.parametrize(
    ("kind", "line", "named"),
    [
        (BOXES, b"0,9007199254740993,1,2,3,4,0", "id is '9007199254740993'"),
        (BOXES, b"0,1,1e300,2,3,4,0", "x is '1e300'"),
        (BOXES, b"0,1,1,2,3,4,7e99", "occ is '7e99'"),
        (BOXES, b"0,1," + LONG + b",2,3,4,0", "CSV"),
        (BOXES, b"0,1," + b"x" * 100_000 + b",2,3,4,0", "x is 'xxxx"),
        (PARTS, LONG + b",,1,2,3,4,5", "CSV"),
        (PARTS, b"b" * 2000 + b",,1,2,3,4,5", "200 letters"),
        (PARTS, b"body,,1e99,2,3,4,5", "x (column 3) is '1e99'"),
    ],
)
def test_a_line_is_refused_by_its_number(tmp_path, kind, line, named):
    read, header = kind
    (tmp_path / "table.csv").write_bytes(header + line + b"\n")
    message = sentence(read, tmp_path / "table.csv")
    assert "line 2 of" in message
    assert named in message


@pytest.mark.parametrize(
    ("meta", "named"),
    [
        ({"frames": "%d%d.png"}, "frames"),
        ({"frames": "%999999999d.png"}, "frames"),
        ({"fps": float("nan")}, "fps"),
        ({"n_frames": 10**12}, "n_frames"),
        ("[" * 100_000, "sequence"),
        ('{"fps": ' + "1" * 5000 + "}", "sequence"),
    ],
)
def test_a_sequences_description_is_refused(tmp_path, meta, named):
    text = meta if isinstance(meta, str) else json.dumps(META | meta)
    (tmp_path / "meta.json").write_text(text)
    message = sentence(open_sequence, tmp_path)
    assert "meta.json" in message
    assert named in message
