"""Bending spaces: bodies keep their length, projection undoes what coordinates do, refusals."""

import jax.numpy as jnp
import numpy as np
import pytest

from jaxpf import InputError
from jaxpf.shapes import basis, bending_space

NUM_POINTS = 9


def bodies(count, seed=0):
    """Control points ``[S, K, 2]`` of bodies of 160 pixels that bend in two ways."""
    rng = np.random.default_rng(seed)
    places = np.arange(NUM_POINTS - 1) / (NUM_POINTS - 1)
    waves = np.stack([np.sin(2 * np.pi * places), np.cos(3 * np.pi * places)])
    waves -= waves.mean(axis=1, keepdims=True)
    angles = rng.normal(size=(count, 2)) @ waves * 0.5 + rng.uniform(-3, 3, (count, 1))
    sides = 20 * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    start = rng.uniform(0, 300, (count, 1, 2))
    return np.concatenate([start, start + np.cumsum(sides, axis=1)], axis=1)


SPACE = bending_space(bodies(40), 7)


def lengths(control):
    return np.linalg.norm(np.diff(control, axis=-2), axis=-1)


def test_every_substate_keeps_the_length():
    substates = np.random.default_rng(1).normal(size=(50, 2, 7)) * 15
    control = np.asarray(SPACE.control_points(jnp.asarray(substates, jnp.float32)))
    np.testing.assert_allclose(lengths(control), 20, rtol=1e-4)
    np.testing.assert_allclose(control.mean(axis=-2), substates[..., :2], atol=1e-3)


def test_projection_finds_the_substate_of_a_body():
    substates = np.random.default_rng(2).normal(size=(50, 1, 7)) * 3
    control = np.asarray(SPACE.control_points(jnp.asarray(substates, jnp.float32)))
    drawn = np.asarray(SPACE.control_points(SPACE.project(control)))
    np.testing.assert_allclose(drawn, control, atol=1e-2)
    one = SPACE.project(control[0])
    np.testing.assert_allclose(one, substates[0], atol=1e-2)


def test_a_body_unlike_the_examples_comes_back_as_one_of_the_same_kind():
    others = bodies(20, seed=3)[:, None]
    drawn = np.asarray(SPACE.control_points(SPACE.project(others)))
    # Two ways to bend, also seen from the other end: four components hold them all.
    np.testing.assert_allclose(drawn, others, atol=0.05)


def test_turns_of_a_track_go_on_and_do_not_jump():
    straight = np.stack([np.arange(NUM_POINTS) * 20.0, np.zeros(NUM_POINTS)], axis=1)
    angles = np.linspace(0, 6 * np.pi, 100)
    matrices = np.array([[[np.cos(a), np.sin(a)], [-np.sin(a), np.cos(a)]] for a in angles])
    turn = SPACE.project((straight @ matrices)[:, None])[:, 0, 2]
    steps = np.diff(turn)
    np.testing.assert_allclose(steps, steps[0], rtol=1e-6)
    # Clockwise in the image, in which y points down.
    assert steps[0] > 0


def test_one_unit_of_every_coordinate_moves_a_straight_body_by_one_pixel():
    rest = np.asarray(SPACE.control_points(np.zeros((1, 7))))[0]
    np.testing.assert_allclose(rest[:, 1], 0, atol=1e-5)
    for unit in np.eye(7):
        change = (np.asarray(SPACE.control_points(1e-2 * unit[None]))[0] - rest) / 1e-2
        assert np.sqrt(np.mean(np.sum(change**2, axis=1))) == pytest.approx(1, rel=1e-2)


def test_points_of_all_particles_are_those_of_the_control_points():
    rows = jnp.asarray(basis(np.linspace(0, 1, 5), NUM_POINTS, closed=False), jnp.float32)
    substates = np.random.default_rng(4).normal(size=(6, 1, 7)).astype(np.float32) * 5
    found = SPACE.points_all(rows, jnp.zeros(6, int), jnp.asarray(substates[:, 0].T))
    expected = np.einsum("rk,nkc->crn", rows, np.asarray(SPACE.control_points(substates))[:, 0])
    np.testing.assert_allclose(found, expected, atol=1e-3)


def test_few_examples_leave_the_turn_alone():
    space = bending_space(bodies(1), NUM_POINTS + 1)
    bends = np.asarray(space.bends)
    np.testing.assert_allclose(bends[1:].sum(axis=1), 0, atol=1e-6)
    assert np.linalg.matrix_rank(bends) == NUM_POINTS - 1


@pytest.mark.parametrize(
    ("examples", "dimension", "match"),
    [
        (np.zeros((0, 9, 2)), 5, r"contours has shape \[0, 9, 2\]; give"),
        (bodies(3), 2, "dimension = 2 must be a whole number from 3 to 10"),
        (bodies(3), 11, "dimension = 11 must be"),
        (np.concatenate([bodies(2), np.ones((1, 9, 2))]), 5, "points of example 2 coincide"),
        (np.full((1, 9, 2), np.nan), 5, "not finite"),
    ],
)
def test_what_has_no_bends_is_refused(examples, dimension, match):
    with pytest.raises(InputError, match=match):
        bending_space(examples, dimension)
