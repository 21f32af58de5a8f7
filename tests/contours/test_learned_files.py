"""Files of learned shape spaces: what is written is read; what is none is refused."""

import json

import jax
import numpy as np
import pytest
from refusals import message_of

from jaxpf.contours.files import Learned, read_learned, write_learned
from jaxpf.dynamics import fit
from jaxpf.shapes import key_frame_space


@pytest.fixture(scope="module")
def learned():
    rng = np.random.default_rng(0)
    space = key_frame_space(rng.normal(0, 9, (9, 6, 2)), 4, closed=False)
    tracks = rng.normal(0, 1, (40, 2, space.dimension)).cumsum(axis=0)
    return Learned(space, fit(tracks, 2, coefficients="own", pooled=True))


def test_what_is_written_is_read(tmp_path, learned):
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
def test_what_is_none_is_refused(tmp_path, learned, damage, named):
    path = tmp_path / "learned.json"
    write_learned(path, learned)
    content = json.loads(path.read_text())
    damage(content)
    path.write_text(json.dumps(content))
    message = message_of(read_learned, path)
    assert named in message
    assert str(path) in message


def test_files_that_are_none_are_refused(tmp_path):
    path = tmp_path / "learned.json"
    assert str(path) in message_of(read_learned, path)
    for text in ("{closed", "[1]"):
        path.write_text(text)
        assert str(path) in message_of(read_learned, path)
