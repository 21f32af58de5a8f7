"""Files of contours: what is written is read; what cannot be used is refused in one sentence."""

import json

import numpy as np
import pytest

from jaxpf import InputError
from jaxpf.contours import Contours
from jaxpf.contours.files import read_contours, write_contours

LEAF = [[10, 20], [30, 18], [32, 40], [12, 38.5]]


def written(folder, **content):
    path = folder / "contours.json"
    path.write_text(json.dumps({"closed": True, "contours": {"leaf": LEAF}, **content}))
    return path


def test_what_is_written_is_read(tmp_path):
    points = np.random.default_rng(0).uniform(0, 400, (2, 6, 2))
    write_contours(tmp_path / "wires.json", Contours(("left", "right"), points, False, 2, 12.5))
    found = read_contours(tmp_path / "wires.json")
    assert (found.names, found.closed, found.degree, found.width) == (
        ("left", "right"),
        False,
        2,
        12.5,
    )
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


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"closed": "yes"}, '"closed" is "yes"'),
        ({"closed": None}, '"closed" is null'),
        ({"degree": 2.5}, '"degree" is 2.5'),
        ({"degree": 0}, "degree = 0 must be"),
        ({"width": 12}, "open contours only"),
        ({"width": -1, "closed": False}, '"width" is -1'),
        ({"contours": {}}, "holds no contours"),
        ({"contours": {"leaf": LEAF[:3]}}, "'leaf': 3 control point"),
        ({"contours": {"a": LEAF, "b": [*LEAF, [1, 2]]}}, "'a' 4, 'b' 5"),
        ({"contours": {"leaf": [*LEAF[:3], [1, "x"]]}}, "point 3 of contour 'leaf'"),
        ({"contours": {"leaf": [*LEAF[:3], [1, float("nan")]]}}, "point 3"),
        ({"contours": {"leaf": [*LEAF[:3], [1, 1e300]]}}, "at most 1000000000"),
        ({"contours": {"leaf": 7}}, "no list of points"),
        ({"contours": {"": LEAF}}, "has the name ''; give 1 to 200 letters on one line"),
        ({"contours": {"two\nlines": LEAF}}, "on one line"),
        ({"contours": {"\ud800": LEAF}}, "on one line"),
        ({"contours": {"x" * 201: LEAF}}, "give 1 to 200 letters"),
        ({"colour": "red"}, "unknown key 'colour'"),
    ],
)
def test_what_cannot_be_used_is_refused(tmp_path, content, message):
    with pytest.raises(InputError, match=message) as refusal:
        read_contours(written(tmp_path, **content))
    assert str(tmp_path) in str(refusal.value)


def test_files_that_are_none_are_refused(tmp_path):
    with pytest.raises(InputError, match="is a folder"):
        read_contours(tmp_path)
    with pytest.raises(InputError, match="there is no file"):
        read_contours(tmp_path / "none.json")
    path = tmp_path / "broken.json"
    path.write_text("{closed")
    with pytest.raises(InputError, match="is no JSON"):
        read_contours(path)
    path.write_text("[" + "9" * 5000 + "]")
    with pytest.raises(InputError, match="is no JSON"):
        read_contours(path)
    path.write_text("[1]")
    with pytest.raises(InputError, match="holds a list"):
        read_contours(path)


def test_two_contours_of_one_name_are_refused(tmp_path):
    path, points = tmp_path / "twice.json", "[[0, 0], [9, 0], [9, 9], [0, 9]]"
    path.write_text(f'{{"closed": true, "contours": {{"leaf": {points}, "leaf": {points}}}}}')
    with pytest.raises(InputError, match=r"twice\.json' holds 'leaf' twice"):
        read_contours(path)
