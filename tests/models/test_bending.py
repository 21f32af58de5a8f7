"""Bodies that bend: their length is a constant, and what they learned they can follow."""

import jax.numpy as jnp
import numpy as np
import pytest

from jaxpf.errors import InputError
from jaxpf.models.bending import PIECES, bending_space
from jaxpf.models.splines import fit_spline, resampled

LENGTH = 120.0


def body(bend, turn=0.0, middle=(100.0, 80.0)):
    """A centreline ``[60, 2]`` of fixed length that bends to one side, or as an S."""
    along = np.linspace(0, 1, 61)
    angle = turn + bend[0] * (along - 0.5) * 2 + bend[1] * np.sin(2 * np.pi * along)
    steps = LENGTH / 60 * np.stack([np.cos(angle[1:]), np.sin(angle[1:])], axis=1)
    line = np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
    return line - line.mean(axis=0) + middle


@pytest.fixture(scope="module")
def bends():
    return np.random.default_rng(0).normal(0, (0.7, 0.5), (30, 2))


@pytest.fixture(scope="module")
def space(bends):
    return bending_space([body(bend) for bend in bends], 5, num_points=10)


def lengths(lines):
    return np.linalg.norm(np.diff(np.asarray(lines), axis=-2), axis=-1).sum(axis=-1)


def test_the_length_is_a_constant_whatever_the_substate(space):
    substates = np.random.default_rng(1).normal(0, 20, (50, 1, 5)).astype(np.float32)
    lines = space.points(substates, np.linspace(0, 1, PIECES + 1))
    np.testing.assert_allclose(lengths(lines), LENGTH, rtol=1e-3)


def test_substates_come_back_from_control_points(space, bends):
    lines = [body(bend, turn) for bend, turn in zip(bends[:8], np.linspace(-3, 3, 8), strict=True)]
    control = np.array([[fit_spline(line, 10, closed=False)] for line in lines])
    substates = space.project(control)
    drawn = space.points(substates.astype(np.float32), np.linspace(0, 1, 61))
    true = np.array([[resampled(line, 61, closed=False)] for line in lines])
    assert np.linalg.norm(drawn - true, axis=-1).max() < 1.0
    assert np.linalg.norm(space.control_points(substates) - control, axis=-1).mean() < 1.0


def test_examples_are_followed_from_either_end_and_in_a_mirror(space, bends):
    line = body(bends[0])
    for seen in (line[::-1], line * (-1, 1), line[::-1] * (1, -1)):
        control = fit_spline(seen, 10, closed=False)[None]
        drawn = np.asarray(space.points(space.project(control), np.linspace(0, 1, 61)))[0]
        assert np.linalg.norm(drawn - resampled(seen, 61, closed=False), axis=-1).max() < 1.0


def test_one_unit_of_each_coordinate_moves_a_straight_body_by_a_pixel(space):
    straight, places = np.zeros((5, 1, 5)), np.linspace(0, 1, PIECES + 1)
    moved = straight + 0.01 * np.eye(5)[:, None]
    gaps = np.asarray(space.points(moved, places)) - np.asarray(space.points(straight, places))
    np.testing.assert_allclose(np.sqrt((gaps**2).sum(axis=-1).mean(axis=-1)), 0.01, rtol=0.02)


def test_directions_are_the_derivatives_of_points(space):
    substates = np.random.default_rng(2).normal(0, 5, (5, 3)).astype(np.float32)
    places, step = np.linspace(0.1, 0.9, 9), 0.5 / PIECES
    _, _, slope_x, slope_y = space.along(jnp.int32(0), jnp.asarray(substates), places)
    after = space.along(jnp.int32(0), jnp.asarray(substates), places + step)
    before = space.along(jnp.int32(0), jnp.asarray(substates), places - step)
    np.testing.assert_allclose((after[0] - before[0]) / (2 * step), slope_x, atol=1.5)
    np.testing.assert_allclose((after[1] - before[1]) / (2 * step), slope_y, atol=1.5)


def test_angles_go_on_through_a_whole_turn(space, bends):
    turns = np.linspace(0, 4 * np.pi, 60)
    control = [[fit_spline(body(bends[0], turn), 10, closed=False)] for turn in turns]
    track = space.project(np.array(control))[:, 0, 2] * float(space.turn)
    np.testing.assert_allclose(np.diff(track), turns[1], atol=0.02)


@pytest.mark.parametrize(
    ("count", "dimension", "message"),
    [(0, 5, "needs key frames"), (30, 2, "dimension 2"), (4, 5, "4 key frame.* fewer than the 5")],
)
def test_what_cannot_be_learned_is_refused(bends, count, dimension, message):
    with pytest.raises(InputError, match=message):
        bending_space([body(bend) for bend in bends[:count]], dimension)
