"""Files of contours: what is written is read; what cannot be used is refused in one sentence."""

import json

import numpy as np
import pytest
from refusals import message_of

from jaxpf.contours import Contours
from jaxpf.contours.files import read_contours, write_contours

LEAF = [[10, 20], [30, 18], [32, 40], [12, 38.5]]


def written(folder, **content):
    path = folder / "contours.json"
    path.write_text(json.dumps({"closed": True, "contours": {"leaf": LEAF}, **content}))
    return path


def test_what_is_written_is_read(tmp_path):
    points = np.random.default_rng(0).uniform(0, 400, (2, 6, 2))
    written = Contours(("left", "right"), points, False, 2, 12.5)
    write_contours(tmp_path / "wires.json", written)
    found = read_contours(tmp_path / "wires.json")
    for name in ("names", "closed", "degree", "width"):
        assert getattr(found, name) == getattr(written, name)
    np.testing.assert_allclose(found.points, points, atol=1e-3)


def test_a_file_written_by_hand_is_read(tmp_path):
    found = read_contours(written(tmp_path))
    np.testing.assert_array_equal(found.points, [LEAF])
    assert (found.names, found.degree, found.width, found.remarks) == (("leaf",), 3, None, ())


def test_a_contour_that_crosses_itself_is_accepted_and_said(tmp_path):
    bow = {"bow": [[0, 0], [100, 100], [100, 0], [0, 100]]}
    found = read_contours(written(tmp_path, contours=bow, degree=1))
    assert found.points.shape == (1, 4, 2)
    assert "'bow'" in found.remarks[0]
    assert "crosses itself" in found.remarks[0]


def four(*last):
    return {"contours": {"leaf": [*LEAF[:3], [*last]]}}


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"closed": "yes"}, '"closed" is "yes"'),
        ({"degree": 2.5}, "degree = 2.5 must be"),
        ({"degree": 0}, "degree = 0 must be"),
        ({"width": 12}, "only with open contours"),
        ({"width": -1, "closed": False}, "width=-1 must be"),
        ({"width": "thin", "closed": False}, "width='thin' must be"),
        ({"contours": {}}, "holds no contours"),
        ({"contours": {"leaf": LEAF[:3]}}, "3 control point"),
        ({"contours": {"a": LEAF, "b": [*LEAF, [1, 2]]}}, "'a' 4, 'b' 5"),
        (four(1, "x"), "point 3 of contour 'leaf'"),
        (four(1, float("nan")), "point 3"),
        (four(1, 1e300), "at most 1000000000"),
        ({"contours": {"leaf": 7}}, "is not a list of points"),
        *(({"contours": {name: LEAF}}, "1 to 200 letters") for name in ("", "\n", "x" * 201)),
        ({"contours": {"\ud800": LEAF}}, "on one line"),
        ({"colour": "red"}, "unknown key 'colour'"),
    ],
)
def test_what_cannot_be_used_is_refused(tmp_path, content, message):
    path = written(tmp_path, **content)
    found = message_of(read_contours, path)
    assert message in found
    assert str(path) in found


def test_files_that_are_none_are_refused(tmp_path):
    assert "is a folder" in message_of(read_contours, tmp_path)
    path, points = tmp_path / "broken.json", "[[0, 0], [9, 0], [9, 9], [0, 9]]"
    assert "there is no file" in message_of(read_contours, path)
    twice = f'{{"closed": true, "contours": {{"leaf": {points}, "leaf": {points}}}}}'
    for text, message in (
        ("{closed", "is no JSON"),
        ("[" + "9" * 5000 + "]", "is no JSON"),
        ("[1]", "holds a list"),
        (twice, "broken.json' holds 'leaf' twice"),
    ):
        path.write_text(text)
        assert message in message_of(read_contours, path)
