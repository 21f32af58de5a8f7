"""Shape spaces: what their coordinates do, that projection undoes them, learning, refusals."""

import jax.numpy as jnp
import numpy as np
import pytest
from refusals import every, message_of

from jaxpf.shapes import key_frame_space, learn_shape_space, space_of
from jaxpf.shapes.learning import outline_of
from jaxpf.shapes.spaces import SHAPE_SPACES

RNG = np.random.default_rng(0)
CONTOURS = RNG.normal(size=(2, 8, 2)) * [40, 25] + [[[100, 60]], [[30, 90]]]


def moved(space, substate):
    """Control points of the second target at a substate, the first one's at rest."""
    substates = np.zeros((2, space.dimension))
    substates[1, : len(substate)] = substate
    return np.asarray(space.control_points(substates))[1]


@pytest.mark.parametrize("name", SHAPE_SPACES)
def test_projection_finds_the_substate_of_a_contour(name):
    space = space_of(name, CONTOURS)
    substates = RNG.normal(size=(5, 2, space.dimension)) * 4
    control = space.control_points(jnp.asarray(substates, jnp.float32))
    np.testing.assert_allclose(space.project(control), substates, atol=1e-3)


def test_the_substate_zero_is_the_template_and_shifts_are_pixels():
    space = space_of("translation", CONTOURS)
    np.testing.assert_allclose(moved(space, [0, 0]), CONTOURS[1], rtol=1e-5)
    np.testing.assert_allclose(moved(space, [3, -5]), CONTOURS[1] + [3, -5], rtol=1e-4)


@pytest.mark.parametrize("name", SHAPE_SPACES)
def test_one_unit_of_every_coordinate_moves_the_contour_by_one_pixel(name):
    space = space_of(name, CONTOURS)
    for unit in np.eye(space.dimension):
        change = moved(space, unit) - CONTOURS[1]
        assert np.sqrt(np.mean(np.sum(change**2, axis=1))) == pytest.approx(1, rel=1e-3)


def test_an_affine_space_holds_every_affine_image():
    space = space_of("affine", CONTOURS)
    image = CONTOURS @ np.array([[1.3, 0.2], [-0.4, 0.8]]) + [12, -7]
    np.testing.assert_allclose(space.control_points(space.project(image)), image, atol=1e-2)


def test_a_similarity_space_grows_and_turns_and_does_not_shear():
    space = space_of("similarity", CONTOURS)
    turned = CONTOURS @ (1.2 * np.array([[0.8, 0.6], [-0.6, 0.8]]))
    np.testing.assert_allclose(space.control_points(space.project(turned)), turned, atol=1e-2)
    sheared = CONTOURS @ np.array([[1.0, 0.5], [0.0, 1.0]])
    assert np.abs(space.control_points(space.project(sheared)) - sheared).max() > 3


def unexplained(space, shapes):
    """Share of the variance in shape that the space does not reach."""
    centred = shapes - shapes.mean(axis=1, keepdims=True)
    rest = centred - space.control_points(space.project(centred[:, None]))[:, 0]
    return np.sum(rest**2) / np.sum((centred - centred.mean(axis=0)) ** 2)


def test_key_frames_span_what_they_vary_in():
    components = RNG.normal(size=(2, 8, 2)) * 5
    shapes = CONTOURS[0] + np.einsum("sd,dkc->skc", RNG.normal(size=(30, 2)), components)
    shapes += RNG.normal(size=(30, 1, 2)) * 50  # shifts belong to the space
    space = key_frame_space(shapes, 4)
    found = space.control_points(space.project(shapes[:, None]))[:, 0]
    np.testing.assert_allclose(found, shapes, atol=1e-2)
    assert unexplained(key_frame_space(shapes, 3), shapes) > 0.01


@every([
    (lambda: key_frame_space(np.ones((3, 8, 2)), 4), "3 key frame"),
    (lambda: key_frame_space(np.ones((30, 8, 2)), 1), "dimension = 1"),
    (lambda: space_of("affine", CONTOURS * [[[np.nan]], [[1]]]), "contour 0"),
    (lambda: space_of("affine", CONTOURS * [1, 0]), "no extent"),
    (lambda: space_of("projective", CONTOURS), "projective"),
])  # fmt: skip
def test_what_makes_no_space_is_refused(call, named):
    assert named in message_of(call)


def ellipse(x, y, a, b, start=0.0):
    angle = start + np.linspace(0, 2 * np.pi, 120, endpoint=False)
    return np.stack([x + a * np.cos(angle), y + b * np.sin(angle)], axis=1)


def test_outlines_are_learned_whatever_their_start_and_sense():
    sizes = np.linspace(20, 40, 9)
    outlines = [ellipse(60, 60, a, 25, start=a) for a in sizes]
    outlines = [line[::-1] if k % 2 else line for k, line in enumerate(outlines)]
    space, control = learn_shape_space(outlines, "outlines", num_points=8, dimension=3)
    assert space.closed
    assert unexplained(space, control) < 0.02


def test_masks_give_their_outlines():
    mask = np.zeros((80, 90), np.uint8)
    mask[20:60, 30:50] = 1
    mask[5, 5] = 1  # a smaller piece
    outline = outline_of(mask)
    np.testing.assert_allclose(outline.min(axis=0), [30, 20])
    np.testing.assert_allclose(outline.max(axis=0), [50, 60])
    masks = [np.pad(mask, ((0, k), (k, 0))) for k in range(5)]
    _, control = learn_shape_space(masks, "masks", num_points=12, dimension=2)
    shifts = control.mean(axis=1) - control[0].mean(axis=0)
    np.testing.assert_allclose(shifts, np.arange(5)[:, None] * [1, 0], atol=1e-6)
    given = [mask, mask, mask * 0], "masks"
    assert "mask 2" in message_of(learn_shape_space, *given, num_points=8, dimension=2)


def test_centrelines_are_turned_to_the_end_that_fits():
    x = np.linspace(0, 100, 18)
    lines = [np.stack([x, 10 * np.sin(x / 20 + k / 4)], axis=1) for k in range(6)]
    mixed = [line[::-1] if k % 2 else line for k, line in enumerate(lines)]
    _, control = learn_shape_space(mixed, "centrelines", num_points=6, dimension=4)
    assert (np.diff(control[:, [0, -1], 0], axis=1) > 0).all()
    _, ordered = learn_shape_space(mixed, "centrelines", num_points=6, dimension=4, ordered=True)
    assert (np.diff(ordered[1::2, [0, -1], 0], axis=1) < 0).all()
