"""Patch likelihood: eskil2014's formula, wherever and however the window lies."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxpf.likelihoods import patch
from jaxpf.likelihoods.patch import patch_from_pictures

HEIGHT, WIDTH = 50, 70
POSES = np.array([[20.0, 20.0, 0.3], [45.0, 25.0, -1.2]])
SIZES = np.array([[14.0, 10.0], [9.0, 16.0]])
#: Of the windows learned from a frame; pictures are of PICTURE's shape and not resampled.
WINDOW = (5, 4)
PICTURE = np.full((22, 22, 3), 100, np.uint8)
COUNT = 51


@jax.jit
def seen_at(likelihood, frame, partition, substates):
    return likelihood.log_prob_all(likelihood.observe(frame), partition, substates)


def values(likelihood, frame, partition, *substates):
    """Log-likelihoods of up to 51 substates, filled up to 51: tests then share one program."""
    more = COUNT - len(substates)
    partition = np.pad(np.broadcast_to(partition, len(substates)), (0, more), mode="edge")
    columns = np.pad(np.array(substates, np.float32), ((0, more), (0, 0)), mode="edge").T
    return np.asarray(seen_at(likelihood, frame, partition, columns))[: len(substates)]


def noise(seed=0):
    frame = np.random.default_rng(seed).uniform(0, 256, (HEIGHT, WIDTH, 3))
    for axis in (0, 1):  # smooth, as pictures are
        frame = (np.roll(frame, 1, axis) + 2 * frame + np.roll(frame, -1, axis)) / 4
    return frame.astype(np.uint8)


def pixel(frame, row, column):
    inside = 0 <= row < HEIGHT and 0 <= column < WIDTH
    return frame[row, column].astype(float) if inside else np.zeros(3)


def seen_one_by_one(frame, substate, size, window):
    """The window's colours by the definition, place by place."""
    u, v, scale, theta = substate
    columns, rows = window
    colours = []
    for i in range(rows):
        for j in range(columns):
            a = ((j + 0.5) / columns - 0.5) * size[0] * scale
            b = ((i + 0.5) / rows - 0.5) * size[1] * scale
            x = u + np.cos(theta) * a - np.sin(theta) * b
            y = v + np.sin(theta) * a + np.cos(theta) * b
            colours.append(pixel(frame, int(np.floor(y)), int(np.floor(x))))
    return np.array(colours)


def test_it_is_the_papers_formula_place_by_place():
    window, sigma, rng = WINDOW, 0.3, np.random.default_rng(1)
    frame, other = noise(1), noise(2)
    likelihood = patch(frame, POSES, SIZES, sigma=sigma, window=window)
    count = COUNT
    substates = np.stack([
        rng.uniform(-5, WIDTH + 5, count), rng.uniform(-5, HEIGHT + 5, count),
        rng.uniform(0.5, 2, count), rng.uniform(-4, 4, count),
    ], axis=1)  # fmt: skip
    substates[0] = -500, 20, 1, 0  # wholly outside
    partition = np.arange(count) % 2
    expected = []
    for p, substate in zip(partition, substates, strict=True):
        start = (POSES[p, 0], POSES[p, 1], 1, POSES[p, 2])
        r = seen_one_by_one(frame, start, SIZES[p], window)
        o = seen_one_by_one(other, substate, SIZES[p], window)
        d = r / r.mean() - o / max(o.mean(), 1)
        expected.append(-(d**2).mean() / sigma**2)
    got = values(likelihood, other, partition, *substates)
    close = np.isclose(got, expected, rtol=1e-3, atol=1e-3)
    # In float32 a place on the edge of a pixel may fall to its other side.
    assert close.mean() > 0.9


@pytest.mark.slow
def test_five_per_cent_off_is_the_figure_of_the_design():
    # 22 x 22 x 3 = 1452 entries, each off by 5% of the mean, half up and half down.
    frame = noise()
    frame[:22, 0:22:2], frame[:22, 1:22:2] = 95, 105
    for sigma, expected in ((0.1 / 1452**0.5, -1452 * 0.0025 / 0.01), (0.1, -0.25)):
        likelihood = patch_from_pictures([PICTURE], window=(22, 22), sigma=sigma)
        got = values(likelihood, frame, 0, (11, 11, 1, 0))
        np.testing.assert_allclose(got, expected, rtol=1e-4)


def test_brightness_does_not_matter_and_the_start_is_the_best_place():
    frame = noise() // 2
    likelihood = patch(frame, POSES, SIZES, window=WINDOW)
    rng = np.random.default_rng(0)
    others = np.insert(POSES[0] + rng.normal(size=(50, 3)) * [3, 3, 0.3], 2, 1, axis=1)
    substates = (POSES[0, 0], POSES[0, 1], 1, POSES[0, 2]), *others
    same = values(likelihood, frame, 0, *substates)
    double = values(likelihood, frame * 2, 0, *substates)
    np.testing.assert_allclose(same[0], 0, atol=1e-6)
    assert np.argmax(same) == 0
    np.testing.assert_allclose(same, double, rtol=1e-4, atol=1e-4)


def test_rotation_is_clockwise_in_the_image():
    start = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    start[:20, :, 0], start[20:, :, 2] = 255, 255  # red over blue: turned, red is right
    likelihood = patch(start, POSES * [1, 1, 0], SIZES, window=WINDOW)
    frame = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    frame[:, 20:, 0], frame[:, :20, 2] = 255, 255
    turned = (20, 20, 1, np.pi / 2), (20, 20, 1, -np.pi / 2)
    right, wrong = values(likelihood, frame, 0, *turned)
    np.testing.assert_allclose(right, 0, atol=1e-5)
    assert wrong < -100


def test_black_windows_and_windows_off_the_frame_are_finite():
    likelihood = patch(noise(), POSES, SIZES, window=WINDOW)
    substates = (20, 20, 1, 0), (-1000, 20, 1, 0), (1e9, 20, 1, 2), (20, 3e30, 1, 0)
    dark = values(likelihood, 0 * noise(), 0, *substates)
    reference = np.asarray(likelihood.references, float)[0]
    np.testing.assert_allclose(dark, -np.mean(reference**2) / 0.01, rtol=1e-5)
    assert np.isfinite(values(likelihood, noise() // 250, 0, *substates)).all()
    nan, inf = np.nan, np.inf
    bad = (nan, 20, 1, 0), (20, 20, 1, inf), (20, 20, 0.01, 0), (20, 20, -1, 0)
    got = values(likelihood, noise(), 0, *bad)
    assert np.isnan(got[:2]).all()
    assert np.isneginf(got[2:]).all()


@pytest.mark.slow
def test_one_particle_agrees_with_all_in_either_precision():
    frame = noise(6)
    for x64 in (False, True):
        with jax.enable_x64(x64):
            likelihood = patch(frame, POSES, SIZES, window=(6, 5))
            observation = likelihood.observe(frame)
            dtype = jnp.float64 if x64 else jnp.float32
            substates = jnp.array([[20, 44], [20, 26], [1, 1.1], [0.2, -1]], dtype)
            every = likelihood.log_prob_all(observation, jnp.arange(2), substates)
            assert every.dtype == dtype
            for p in range(2):
                one = likelihood.log_prob(observation, p, substates[:, p])
                np.testing.assert_allclose(one, every[p], rtol=1e-5)
            upright = likelihood.log_prob_all(observation, jnp.arange(2), substates[:3])
            flat = substates.at[3].set(0)
            np.testing.assert_allclose(
                upright, likelihood.log_prob_all(observation, jnp.arange(2), flat)
            )
