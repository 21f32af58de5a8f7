"""A filter's state, saved and gone on with: what is refused, and what the refusal must name.

``test_round_trips.py`` reads what was saved, and ``tests/running/test_resuming.py`` goes on.
"""

import jax
import numpy as np
import pytest
from models import partitioned
from refusals import message_of

import jaxpf
from jaxpf.filters import SideBySide

KEY = jax.random.key(1)


def one(num_particles=20, num_objects=2):
    return partitioned(number=num_objects, num_particles=num_particles)


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    path = tmp_path_factory.mktemp("state") / "first.npz"
    jaxpf.save(path, one().init(KEY))
    return path


def in_double_precision(saved):
    with jax.enable_x64(True):
        jaxpf.load(saved, partitioned(num_particles=20, initial=np.zeros((2, 1))))


@pytest.mark.parametrize(
    ("call", "named"),
    [
        (lambda saved: jaxpf.load(saved, one(30)), "particles"),
        (lambda saved: jaxpf.load(saved, one(20, 3)), "objects"),
        (lambda saved: jaxpf.load(saved, SideBySide(one(), 2)), "SideBySide"),
        (in_double_precision, "jax_enable_x64"),
        (lambda saved: jaxpf.load(saved.with_name("none.npz"), one()), "none.npz"),
        (lambda saved: jaxpf.save("", jaxpf.load(saved, one())), "path"),
        (lambda saved: jaxpf.forecast(one(), KEY, jaxpf.load(saved, one()), 0), "steps"),
    ],
)
def test_what_does_not_fit_is_refused(saved, call, named):
    assert named in message_of(call, saved)


@pytest.mark.parametrize("content", [b"nothing", b"", {"format": "x"}, {"time": 1},
                                     {"format": np.array([{}], object)}])  # fmt: skip
def test_what_is_no_state_is_refused(tmp_path, content):
    path = tmp_path / "x.npz"
    if isinstance(content, bytes):
        path.write_bytes(content)
    else:
        np.savez(path, **content)
    assert "jaxpf.save" in message_of(jaxpf.load, path, one())


def test_another_format_is_told(tmp_path):
    for other in (1, 99):  # files of format 1 do not say when the state was
        np.savez(tmp_path / "x.npz", format=other)
        assert f"format {other}" in message_of(jaxpf.load, tmp_path / "x.npz", one())
