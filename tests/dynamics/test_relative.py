"""Motion relative to the size: its moments, its density, and a share of long steps."""

import jax
import numpy as np
import pytest

from jaxpf.dynamics.relative import RelativeMotion

SIZES = np.array([[20.0, 45.0], [8.0, 8.0]], np.float32)  # sides of 30 and 8 pixels
STEPS = np.array([[0.03, 0.12, 0.015], [0.05, 0.2, 0.0]], np.float32)
MOTION = RelativeMotion(SIZES, STEPS, long=np.array([0.4, 0.1], np.float32))
NUMBER = 200_000
CURRENT, BEFORE = np.array([50.0, 40.0, 1.2]), np.array([44.0, 41.0, 1.1])


def columns(x):
    return np.broadcast_to(np.asarray(x, np.float32)[:, None], (len(x), NUMBER))


@pytest.mark.parametrize("number", [0, 1])
def test_moments_are_those_of_the_mixture(number):
    draw = jax.jit(MOTION.propagate_all)
    partition = np.full(NUMBER, number)
    new = np.asarray(
        draw(jax.random.key(number), partition, columns(CURRENT), columns(BEFORE), columns([0] * 3))
    )
    usual, far, of_size = STEPS[number].astype(float)
    long = (0.4, 0.1)[number]
    side = (30.0, 8.0)[number] * CURRENT[2]
    away = (new[:2].astype(float) - (CURRENT + 0.3 * (CURRENT - BEFORE))[:2, None]) / side
    for power, moment in ((2, 1), (4, 3)):
        expected = moment * ((1 - long) * usual**power + long * far**power)
        values = away**power
        error = values.std(axis=1) / np.sqrt(NUMBER)
        np.testing.assert_array_less(np.abs(values.mean(axis=1) - expected), 4.5 * error)
    # One coin for both coordinates: long steps are long in both.
    assert np.corrcoef(away**2)[0, 1] > 0.1
    logs = np.log(new[2].astype(float)) - 0.98 * np.log(CURRENT[2])
    assert abs(logs.mean()) < 4.5 * of_size / np.sqrt(NUMBER) + 1e-6
    assert logs.std() == pytest.approx(of_size, rel=0.01, abs=1e-6)


def test_the_density_is_one_in_all_and_is_where_draws_are():
    motion = RelativeMotion(SIZES[:1], STEPS[0])
    drift = CURRENT + 0.3 * (CURRENT - BEFORE)
    side, log_size = 30 * CURRENT[2], 0.98 * np.log(CURRENT[2])
    steps = np.linspace(-0.6, 0.6, 81)
    sizes = np.exp(log_size + 0.015 * np.linspace(-6, 6, 41))
    u, v, a = np.meshgrid(drift[0] + side * steps, drift[1] + side * steps, sizes, indexing="ij")
    new = np.stack([u.ravel(), v.ravel(), a.ravel()])
    every = [np.broadcast_to(x[:, None], new.shape) for x in (CURRENT, BEFORE, np.zeros(3))]
    with jax.enable_x64(True):
        log_density = jax.jit(motion.log_density_all)(np.zeros(new.shape[1], int), new, *every)
    density = np.exp(np.asarray(log_density)).reshape(u.shape)

    def integral(values):
        return np.trapezoid(np.trapezoid(np.trapezoid(values, sizes), side * steps), side * steps)

    assert integral(density) == pytest.approx(1, abs=0.01)
    # The share within 2 usual steps, against draws.
    near = np.hypot(u - drift[0], v - drift[1]) < 0.09 * side
    share = integral(np.where(near, density, 0))
    past = columns(CURRENT), columns(BEFORE), columns([0] * 3)
    drawn = jax.jit(motion.propagate_all)(jax.random.key(5), np.zeros(NUMBER, int), *past)
    away = np.hypot(*(np.asarray(drawn)[:2] - drift[:2, None])) < 0.09 * side
    assert away.mean() == pytest.approx(share, abs=0.02)


def test_a_size_without_noise_is_left_out_of_the_density():
    still = RelativeMotion(SIZES[:1], np.array([0.03, 0.12, 0.0]))
    new = np.array([50.0, 40.0, 1.0], np.float32)
    density = jax.jit(still.log_density)(np.int32(0), new, new, new, np.zeros(3, np.float32))
    shares = 0.6 / (2 * np.pi * 0.9**2) + 0.4 / (2 * np.pi * 3.6**2)
    assert float(density) == pytest.approx(np.log(shares), rel=1e-5)
