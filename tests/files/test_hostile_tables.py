"""Tables that nobody meant to write: one short sentence that names the line."""

import json

import pytest

import scenes
from jaxpf import InputError
from jaxpf.boxes import read_boxes
from jaxpf.parts.files import read_parts

BOXES, PARTS = b"frame,id,x,y,w,h,occ\n", b"part,parent,x,y,w,h,angle\n"
LONG = b"9" * 2_000_000
META = {"name": "a", "frames": "%d.png", "n_frames": 1, "width": 4, "height": 4, "fps": 1}


def sentence(call, *arguments):
    """The refusal: one line, and short whatever the file holds."""
    with pytest.raises((InputError, scenes.SceneError)) as caught:
        call(*arguments)
    message = str(caught.value)
    assert "\n" not in message
    assert len(message) < 400
    return message


@pytest.mark.parametrize(
    ("line", "said"),
    [
        (b"0,9007199254740993,1,2,3,4,0", "the id 9007199254740993; give one below"),
        (b"0,1,1e300,2,3,4,0", "a box beyond 1000000000 pixels"),
        (b"0,1,1,2,3,4,7e99", "the occ 7e+99"),
        (b"0,1," + LONG + b",2,3,4,0", "is no CSV"),
        (b"0,1," + b"x" * 100_000 + b",2,3,4,0", "column 3 is 'xxxx"),
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
        (b"b" * 2000 + b",,1,2,3,4,5", "has 2000 letters in column 1"),
        (b"body,,1e99,2,3,4,5", "give a number of at most 1000000000"),
    ],
)
def test_a_line_of_parts_is_refused_by_its_number(tmp_path, line, said):
    (tmp_path / "parts.csv").write_bytes(PARTS + line + b"\n")
    message = sentence(read_parts, tmp_path / "parts.csv")
    assert "line 2 of" in message
    assert said in message


@pytest.fixture
def clip(tmp_path):
    """A folder, written anew with other truth or another description."""

    def write(lines=b"0,1,1,2,3,4,0\n", text=None, **meta):
        (tmp_path / "0.png").touch()
        (tmp_path / "meta.json").write_text(text or json.dumps(META | meta))
        (tmp_path / "gt.csv").write_bytes(BOXES + lines)
        return tmp_path

    return write


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        (b"0,1,\xe9,2,3,4,0\n", "gt.csv, line 2 holds a byte that is no UTF-8"),
        (b"0,1," + LONG + b",2,3,4,0\n", "gt.csv, line 2 is no CSV"),
        (b"0,1," + b"9" * 9999 + b",2,3,4,0\n", "is not a finite number"),
        (b"0,18014398509481985,1,2,3,4,0\n", "id = '18014398509481985' is beyond"),
        (b"0,1,1e300,2,3,4,0\n", "x = '1e300' is beyond 1000000000"),
    ],
)
def test_a_line_of_a_clips_truth_is_refused_by_its_number(clip, lines, said):
    message = sentence(scenes.read_clip, clip(lines))
    assert "gt.csv, line 2" in message
    assert said in message


@pytest.mark.parametrize(
    ("meta", "said"),
    [
        ({"frames": "%d%d.png"}, "is no pattern"),
        ({"frames": "%999999999d.png"}, "is no pattern"),
        ({"fps": float("nan")}, "fps = nan must be a number above 0"),
        ({"n_frames": 10**12}, "must be at most 1000000"),
        ({"text": "[" * 100_000}, "nested too deeply"),
        ({"text": '{"fps": ' + "1" * 5000 + "}"}, "is not valid JSON"),
    ],
)
def test_a_clips_description_is_refused(clip, meta, said):
    message = sentence(scenes.read_clip, clip(**meta))
    assert "meta.json" in message
    assert said in message
