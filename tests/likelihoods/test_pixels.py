"""The pixel likelihood (rowe2005, eq. 3): mean against product, power and size term."""

import dataclasses
import math

import jax
import numpy as np
import pytest

from jaxpf.likelihoods import pixels

SIGMA = 10.0


def picture(seed, height=24, width=16):
    """A look of 8 by 8 cells of 3 by 2 pixels."""
    cells = np.random.default_rng(seed).integers(0, 256, (8, 8, 3), dtype=np.uint8)
    return cells.repeat(height // 8, axis=0).repeat(width // 8, axis=1)


def frame_with(patch, left=20, top=30, level=128):
    frame = np.full((90, 100, 3), level, np.uint8)
    frame[top : top + patch.shape[0], left : left + patch.shape[1]] = patch
    return frame


def likelihood(**settings):
    return pixels([picture(0), picture(1)], **({"sigma": SIGMA, "window": (8, 8)} | settings))


@jax.jit
def log_prob_all(model, frame, near, labels, substates):
    seen = model.observe(frame)
    seen = seen if near is None else model.look_near(seen, near)
    return model.log_prob_all(seen, labels, substates)


def log_prob(model, frame, *substates, target=0, near=None):
    """Log-likelihoods of up to four substates, filled up to four: tests then share a program."""
    filled = [*substates, *substates[-1:] * (4 - len(substates))]
    columns = np.array(filled, np.float32).T
    found = log_prob_all(model, frame, near, np.full(len(filled), target), columns)
    return np.asarray(found)[: len(substates)]


TRUE = (28.0, 42.0, 16.0, 24.0)  # centre and sides of the patch in frame_with


@pytest.mark.parametrize("colour", ["colour", "grey"])
@pytest.mark.parametrize("pool", ["mean", "product"])
def test_equation_3_is_computed_as_by_hand(pool, colour):
    model = likelihood(pool=pool, colour=colour)
    noisy = frame_with(picture(0)).astype(float)
    noisy += np.random.default_rng(2).normal(0, SIGMA, noisy.shape)
    noisy = np.clip(np.rint(noisy), 0, 255).astype(np.uint8)
    shown, own = (  # every second column and third row, at the middles of the picture's cells
        x[1::3, 1::2].reshape(-1, 3).astype(float) for x in (noisy[30:54, 20:36], picture(0))
    )
    if colour == "grey":
        shown, own = (np.rint(x @ [[0.299], [0.587], [0.114]]) for x in (shown, own))
    density = -0.5 * ((shown - own) / SIGMA) ** 2 - math.log(SIGMA * math.sqrt(2 * math.pi))
    density = density.sum(axis=-1)
    expected = density.sum() if pool == "product" else np.log(np.mean(np.exp(density)))
    np.testing.assert_allclose(log_prob(model, noisy, TRUE), [expected], rtol=1e-4)


def test_the_mean_is_not_the_product():
    """The mutation: with half the box hidden, the mean loses a factor 2, the product all."""
    frame = frame_with(picture(0))
    hidden = frame.copy()
    hidden[42:54] = 255 - hidden[42:54]  # the lower half
    whole, half = (log_prob(likelihood(), x, TRUE)[0] for x in (frame, hidden))
    assert half - whole == pytest.approx(math.log(0.5), abs=0.05)
    model = likelihood(pool="product")
    assert log_prob(model, hidden, TRUE)[0] - log_prob(model, frame, TRUE)[0] < -1000


def test_the_power_makes_a_shift_cost_what_was_asked_for():
    """A shift of a whole cell of 8 leaves 7/8 of the box: A^k with k = s max(w, h)."""
    slope = 0.5
    cells = np.random.default_rng(0).choice([0, 255], (8, 8, 1)).astype(np.uint8)
    patch = np.repeat(cells.repeat(3, 0).repeat(2, 1), 3, axis=-1)
    model = pixels([patch, picture(1)], sigma=SIGMA, window=(8, 8), min_slope=slope)
    plain = dataclasses.replace(model, min_slope=None)
    frame = frame_with(patch)
    shifted = (30.0, 42.0, 16.0, 24.0)
    change = np.diff(log_prob(model, frame, TRUE, shifted))
    plain_change = np.diff(log_prob(plain, frame, TRUE, shifted))
    np.testing.assert_allclose(change, slope * 24 * plain_change, rtol=1e-3)
    small = log_prob(model, frame, TRUE, near=np.array([[28.0, 42.0, 1.0, 1.5]] * 2))
    np.testing.assert_allclose(small, log_prob(plain, frame, TRUE))


def test_the_power_does_not_depend_on_the_units_of_intensity():
    frame, dark = frame_with(picture(0) // 2 * 2), frame_with(picture(0) // 2, level=64)
    pictures = [picture(0) // 2, picture(1) // 2]
    model = pixels([2 * x for x in pictures], sigma=20.0, window=(8, 8), min_slope=1.0)
    other = pixels(pictures, sigma=10.0, window=(8, 8), min_slope=1.0)
    shifted = (29.0, 44.0, 16.0, 24.0)
    first, second = log_prob(model, frame, TRUE, shifted), log_prob(other, dark, TRUE, shifted)
    np.testing.assert_allclose(np.diff(first), np.diff(second), rtol=1e-4)


def test_the_size_term_favours_larger_boxes_by_area_over_expected_area():
    plain, model = likelihood(), likelihood(size_term=2.0)
    frame = frame_with(picture(0))
    boxes = [TRUE, (28.0, 42.0, 32.0, 24.0), (28.0, 42.0, 8.0, 12.0)]
    added = log_prob(model, frame, *boxes) - log_prob(plain, frame, *boxes)
    np.testing.assert_allclose(added, 2 * np.log([1, 2, 0.25]), atol=1e-4)
    near = np.array([[28.0, 42.0, 32.0, 24.0], [0, 0, 1, 1]])
    added = log_prob(model, frame, *boxes, near=near) - log_prob(plain, frame, *boxes)
    np.testing.assert_allclose(added, 2 * np.log([0.5, 1, 0.125]), atol=1e-4)


def test_what_is_no_box_has_no_likelihood():
    found = log_prob(
        likelihood(size_term=1.0),
        frame_with(picture(0)),
        (28.0, 42.0, 0.5, 24.0),
        (28.0, 42.0, -3.0, 24.0),
        (np.nan, 42.0, 16.0, 24.0),
        (1e6, -1e6, 16.0, 24.0),
    )
    assert np.isneginf(found[:2]).all()
    assert np.isnan(found[2])
    assert np.isfinite(found[3])
