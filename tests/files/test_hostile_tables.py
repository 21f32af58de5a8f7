"""Tables that nobody meant to write: one short sentence that names the line."""

import json

import pytest

from jaxpf import InputError
from jaxpf.boxes import read_boxes
from jaxpf.parts.files import read_parts
from jaxpf.sequences import open_sequence

BOXES, PARTS = b"frame,id,x,y,w,h,occ\n", b"part,parent,x,y,w,h,angle\n"
LONG = b"9" * 2_000_000
META = {"name": "a", "frames": "%d.png", "n_frames": 1, "width": 4, "height": 4, "fps": 1}


def sentence(call, *arguments):
    """The refusal: one line, and short whatever the file holds."""
    with pytest.raises(InputError) as caught:
        call(*arguments)
    message = str(caught.value)
    assert "\n" not in message
    assert len(message) < 400
    return message


@pytest.mark.parametrize(
    ("line", "said"),
    [
        (b"0,9007199254740993,1,2,3,4,0", "id is '9007199254740993'; give a whole number"),
        (b"0,1,1e300,2,3,4,0", "x is '1e300'; give a number from -1000000000 to"),
        (b"0,1,1,2,3,4,7e99", "occ is '7e99'"),
        (b"0,1," + LONG + b",2,3,4,0", "is no CSV"),
        (b"0,1," + b"x" * 100_000 + b",2,3,4,0", "x is 'xxxx"),
    ],
)
def test_a_line_of_boxes_is_refused_by_its_number(tmp_path, line, said):
    (tmp_path / "boxes.csv").write_bytes(BOXES + line + b"\n")
    message = sentence(read_boxes, tmp_path / "boxes.csv")
    assert "line 2 of" in message
    assert said in message


@pytest.mark.parametrize(
    ("line", "said"),
    [
        (LONG + b",,1,2,3,4,5", "is no CSV"),
        (b"b" * 2000 + b",,1,2,3,4,5", "give 1 to 200 letters on one line"),
        (b"body,,1e99,2,3,4,5", "give a number from -1000000000 to 1000000000"),
    ],
)
def test_a_line_of_parts_is_refused_by_its_number(tmp_path, line, said):
    (tmp_path / "parts.csv").write_bytes(PARTS + line + b"\n")
    message = sentence(read_parts, tmp_path / "parts.csv")
    assert "line 2 of" in message
    assert said in message


@pytest.mark.parametrize(
    ("meta", "said"),
    [
        ({"frames": "%d%d.png"}, "name a video, or frames/%04d.png"),
        ({"frames": "%999999999d.png"}, "name a video, or frames/%04d.png"),
        ({"fps": float("nan")}, "fps is 'nan'"),
        ({"n_frames": 10**12}, "give a whole number from 1 to 1000000"),
        ({"text": "[" * 100_000}, "describes no sequence"),
        ({"text": '{"fps": ' + "1" * 5000 + "}"}, "describes no sequence"),
    ],
)
def test_a_sequences_description_is_refused(tmp_path, meta, said):
    text = meta.get("text") or json.dumps(META | meta)
    (tmp_path / "meta.json").write_text(text)
    message = sentence(open_sequence, tmp_path)
    assert "meta.json" in message
    assert said in message
