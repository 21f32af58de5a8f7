import jax
import numpy as np
import pytest

from jaxpf import shapes
from jaxpf.shapes import rectangles
from jaxpf.shapes.rectangles import corners_from_poses, cos_sin, is_proper

boxes_from_substates = jax.jit(shapes.boxes_from_substates)
intersection_area, area = jax.jit(rectangles.intersection_area), jax.jit(rectangles.area)
cos_sin = jax.jit(cos_sin)

SIZES = np.array([[32.0, 42.0], [10.0, 20.0]])

DEGENERATE = [
    [0.0, 0.0, 0.0, 5.0],
    [0.0, 0.0, 5.0, 0.0],
    [0.0, 0.0, -5.0, 5.0],
    [0.0, 0.0, -5.0, -5.0],
    [np.nan, 0.0, 5.0, 5.0],
    [0.0, 0.0, 5.0, np.nan],
    [0.0, 0.0, np.inf, 5.0],
]


def test_box_is_centred_and_scaled():
    # Scale 1: 100 - 32/2 = 84, 80 - 42/2 = 59.  Scale 2 of 10 x 20: 20 x 40 at 50 - 10, 60 - 20.
    substates = np.array([[100.0, 80.0, 1.0, 7.0], [50.0, 60.0, 2.0, 9.0]])
    boxes = boxes_from_substates(substates, SIZES)
    np.testing.assert_allclose(boxes, [[84, 59, 32, 42], [40, 40, 20, 40]])


def test_intersection_by_hand():
    one = np.array([0.0, 0.0, 10.0, 10.0])
    # x from 6 to 10 and y from 7 to 10: 4 * 3.
    assert intersection_area(one, np.array([6.0, 7.0, 10.0, 10.0])) == 12
    # Inside: the smaller box itself, 2 * 3.
    assert intersection_area(one, np.array([1.0, 1.0, 2.0, 3.0])) == 6
    # Apart in x although not in y.
    assert intersection_area(one, np.array([20.0, 0.0, 10.0, 10.0])) == 0
    # Apart in both: the product of two negative lengths must not count.
    assert intersection_area(one, np.array([20.0, 20.0, 10.0, 10.0])) == 0
    # A common edge is no common area.
    assert intersection_area(one, np.array([10.0, 0.0, 10.0, 10.0])) == 0


def test_intersection_broadcasts_and_commutes():
    rng = np.random.default_rng(1)
    one = rng.uniform(1, 20, (6, 1, 4))
    other = rng.uniform(1, 20, (3, 4))
    there = np.asarray(intersection_area(one, other))
    assert there.shape == (6, 3)
    assert (there > 0).any()
    np.testing.assert_array_equal(there, intersection_area(other, one))


def test_intersection_never_exceeds_a_box_whatever_the_rounding():
    # In float32 300.1 + .1 - 300.1 is not .1.
    boxes = np.random.default_rng(2).uniform([300, 300, 0.05, 0.05], [400, 400, 0.2, 0.2], (500, 4))
    boxes = boxes.astype(np.float32)
    assert np.all(intersection_area(boxes, boxes) <= area(boxes))


@pytest.mark.parametrize("box", DEGENERATE)
def test_degenerate_boxes_cover_nothing(box):
    box, everything = np.array(box), np.array([-100.0, -100.0, 200.0, 200.0])
    assert area(box) == 0
    assert intersection_area(box, everything) == 0
    assert intersection_area(everything, box) == 0
    assert not jax.jit(is_proper)(box)


def test_area_takes_whole_numbers():
    twelve = rectangles.area([1, 2, 3, 4])
    assert twelve == 12
    assert twelve.dtype == np.float32


def test_gradient_of_the_intersection_survives_absent_boxes():
    def common(boxes):
        return intersection_area(boxes, np.array([0.0, 0.0, 10.0, 10.0])).sum()

    boxes = np.array([[2.0, 3.0, 4.0, 20.0], [np.nan] * 4])
    # The first box shares 4 * 7: moving it down by dy takes 4 dy, widening it by dw adds 7 dw.
    np.testing.assert_allclose(
        jax.jit(jax.grad(common))(boxes), [[0, -4, 7, 0], [0, 0, 0, 0]], atol=1e-6
    )


def test_cosine_and_sine_are_right_in_every_quadrant_and_far_away():
    angles = np.concatenate([np.linspace(-10, 10, 4001), np.linspace(-1e4, 1e4, 4001)])
    angles = angles.astype(np.float32)
    cosine, sine = cos_sin(angles)
    assert cosine.dtype == sine.dtype == np.float32
    np.testing.assert_allclose(cosine, np.cos(angles.astype(float)), atol=3e-7)
    np.testing.assert_allclose(sine, np.sin(angles.astype(float)), atol=3e-7)
    assert np.isfinite(cos_sin(np.float32(3e30))).all()
    assert np.isnan(cos_sin(np.float32(np.nan))).all()


def test_gradients_of_cosine_and_sine_are_theirs():
    angles = np.linspace(-7, 7, 201, dtype=np.float32)
    got = jax.jit(jax.vmap(jax.jacrev(cos_sin)))(angles)
    np.testing.assert_allclose(got[0], -np.sin(angles.astype(float)), atol=2e-6)
    np.testing.assert_allclose(got[1], np.cos(angles.astype(float)), atol=2e-6)


def test_cosine_and_sine_under_x64():
    with jax.enable_x64(True):
        angles = np.linspace(-7, 7, 51)
        np.testing.assert_allclose(cos_sin(angles)[0], np.cos(angles), atol=1e-15)


def test_corners_of_rectangles_by_hand():
    # 4 x 2 at (10, 20): upright, and turned clockwise by a right angle.
    poses = np.array([[10.0, 20.0, 0.0, 99.0], [10.0, 20.0, np.pi / 2, 99.0]])
    corners = jax.jit(corners_from_poses)(poses, np.array([[4.0, 2.0], [4.0, 2.0]]))
    assert corners.shape == (2, 4, 2)
    np.testing.assert_allclose(corners[0], [[8, 19], [12, 19], [12, 21], [8, 21]], atol=1e-5)
    np.testing.assert_allclose(corners[1], [[11, 18], [11, 22], [9, 22], [9, 18]], atol=1e-5)
