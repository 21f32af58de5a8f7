"""Files of contours: what is written is read; what cannot be used is refused in one sentence."""

import json

import jax
import numpy as np
import pytest
from hypothesis import given, strategies as st
from hypothesis.extra.numpy import arrays
from properties import EVERY, coordinates, extents, names
from refusals import message_of

from jaxpf.contours import Contours
from jaxpf.contours.files import (
    Learned,
    contours_text,
    read_contours,
    read_learned,
    write_learned,
)
from jaxpf.dynamics import fit
from jaxpf.shapes import key_frame_space

LEAF = [[10, 20], [30, 18], [32, 40], [12, 38.5]]


def written(folder, **content):
    path = folder / "contours.json"
    path.write_text(json.dumps({"closed": True, "contours": {"leaf": LEAF}, **content}))
    return path


@EVERY
@given(data=st.data(), closed=st.booleans(), degree=st.integers(1, 3))
def test_what_is_written_is_read(tmp_path_factory, data, closed, degree):
    path = tmp_path_factory.getbasetemp() / "wires.json"
    found = data.draw(st.lists(names, min_size=1, max_size=3, unique=True))
    points = data.draw(arrays(float, (len(found), 6, 2), elements=coordinates))
    width = None if closed else data.draw(st.none() | extents)
    written = Contours(tuple(found), points, closed, degree, width)
    path.write_text(contours_text(written), "utf-8")
    read = read_contours(path)
    for name in ("names", "closed", "degree", "width"):
        assert getattr(read, name) == getattr(written, name)
    np.testing.assert_allclose(read.points, points, atol=1e-3)


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
    ("content", "named"),
    [
        ({"closed": "yes"}, '"closed"'),
        ({"degree": 2.5}, "degree"),
        ({"degree": 0}, "degree"),
        ({"width": 12}, "open contours"),
        ({"width": -1, "closed": False}, "width"),
        ({"width": "thin", "closed": False}, "width"),
        ({"width": "4", "closed": False}, "width"),
        ({"contours": {"leaf": [[True, 1], [2, 3], [4, 1], [5, 9]]}}, "point 0"),
        ({"contours": {}}, "it has no contours"),
        ({"contours": {"leaf": LEAF[:3]}}, "3 control point"),
        ({"contours": {"a": LEAF, "b": [*LEAF, [1, 2]]}}, "'a' 4, 'b' 5"),
        (four(1, "x"), "point 3 of contour 'leaf'"),
        (four(1, float("nan")), "point 3"),
        (four(1, 1e300), "at most 1000000000"),
        ({"contours": {"leaf": 7}}, "'leaf'"),
        *(({"contours": {name: LEAF}}, "letters") for name in ("", "\n", "x" * 201)),
        ({"contours": {"\ud800": LEAF}}, "on one line"),
        ({"colour": "red"}, "'colour'"),
    ],
    ids=range(20),
)
def test_what_cannot_be_used_is_refused(tmp_path, content, named):
    path = written(tmp_path, **content)
    message = message_of(read_contours, path)
    assert named in message
    assert str(path) in message


@pytest.mark.parametrize(
    "text",
    ["{closed", "[" + "9" * 5000 + "]", "[1]", '{"closed": true, "contours": {"a": 1, "a": 2}}'],
    ids=range(4),
)
def test_files_that_are_none_are_refused(tmp_path, text):
    path = tmp_path / "broken.json"
    path.write_text(text)
    for place in (path, tmp_path, tmp_path / "nowhere.json"):
        for read in (read_contours, read_learned):
            assert place.name in message_of(read, place)


@pytest.fixture(scope="module")
def learned():
    rng = np.random.default_rng(0)
    space = key_frame_space(rng.normal(0, 9, (9, 6, 2)), 4, closed=False)
    tracks = rng.normal(0, 1, (40, 2, space.dimension)).cumsum(axis=0)
    return Learned(space, fit(tracks, 2, coefficients="own", pooled=True))


def test_a_learned_model_is_read_as_it_was_written(tmp_path, learned):
    write_learned(tmp_path / "learned.json", learned)
    found = read_learned(tmp_path / "learned.json")
    assert (found.space.num_points, found.space.closed, found.space.degree) == (6, False, 3)
    for one, other in zip(*map(jax.tree.leaves, (found, learned)), strict=True):
        np.testing.assert_allclose(one[0], other[0], rtol=1e-6)
    write_learned(tmp_path / "learned.json", learned._replace(dynamics=None))
    assert read_learned(tmp_path / "learned.json").dynamics is None


@pytest.mark.parametrize(
    ("damage", "named"),
    [
        (lambda content: content.pop("space"), "'space'"),
        (lambda content: content["space"].pop("modes"), "'modes'"),
        (lambda content: content["space"].update(degree=9), "degree 9"),
        (lambda content: content["space"].update(degree=float("inf")), "learned"),
        (lambda content: content["dynamics"].update(noise=[1, 2]), "noise"),
        (lambda content: content["dynamics"].update(offset=[float("nan")] * 4), "offset"),
    ],
)
def test_a_damaged_model_is_refused(tmp_path, learned, damage, named):
    path = tmp_path / "learned.json"
    write_learned(path, learned)
    content = json.loads(path.read_text())
    damage(content)
    path.write_text(json.dumps(content))
    message = message_of(read_learned, path)
    assert named in message
    assert str(path) in message
