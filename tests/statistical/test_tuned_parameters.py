"""Tuning finds the parameters that made linear-Gaussian data, wherever it starts."""

import jax.numpy as jnp
import numpy as np
import pytest

import jaxpf
from jaxpf import ordering, tune
from jaxpf.dynamics import RandomWalk
from jaxpf.gradients import StopGradient
from jaxpf.likelihoods import Gaussian, kalman
from jaxpf.tuning import Settings, TrainingSequence

MOTION, NOISE = 0.8, 0.6
NUM_SEQUENCES, NUM_FRAMES, STARTS = 16, 12, 10


def data():
    rng = np.random.default_rng(5)
    shape = (NUM_SEQUENCES, NUM_FRAMES, 1, 1)
    places = np.cumsum(MOTION * rng.standard_normal(shape), axis=1)
    return places + NOISE * rng.standard_normal(shape)


def exact_log_evidence(frames, free):
    motion, noise = np.exp(free)
    one = np.eye(1)
    return sum(
        kalman(
            one, motion**2 * one, one, noise**2 * one, np.zeros(1), 0 * one, sequence[:, 0]
        )[0].sum()
        for sequence in frames
    )  # fmt: skip


@pytest.mark.statistical
@pytest.mark.slow
def test_known_parameters_are_recovered_within_three_standard_errors_from_ten_starts():
    frames = data()
    tracker = jaxpf.Partitioned(
        dynamics=RandomWalk(scale=jnp.array([2.0])),
        likelihood=Gaussian(noise=jnp.full((1, 1, 1), 1.5)),
        ordering=ordering.sir(1),
        initial=jnp.zeros((1, 1)),
        num_particles=100,
        gradient=StopGradient(),
    )
    settings = Settings(
        steps=60, learning_rate=0.1, runs=8, sequences_per_step=4, window=25, tolerance=0.03,
        repeats=STARTS, jitter=0.8, clip=5.0,
    )  # fmt: skip
    result = tune(
        [TrainingSequence(tracker, sequence) for sequence in frames],
        ["dynamics.scale", "likelihood.noise=0:"],
        settings=settings,
    )
    names = ["dynamics.scale", "likelihood.noise"]
    tails = np.array(
        [[float(d.free[n][-settings.window :].mean()) for n in names] for d in result.descents]
    )
    starts = np.array([[float(d.free[n][0].squeeze()) for n in names] for d in result.descents])
    assert np.ptp(starts, axis=0).min() > np.log(2), "starts differ by a factor of two and more"
    by_frames = np.array([float(result.curvature_errors[n].squeeze()) for n in names])
    by_chance = tails.std(axis=0, ddof=1)
    error = np.hypot(by_frames, by_chance)
    z = (tails - np.log([MOTION, NOISE])) / error
    print("z of the starts:", np.round(z, 2).tolist(), "errors:", by_frames, by_chance)
    assert (np.abs(z) < 3).all()
    # All starts end at one place, which is the exact maximum of the evidence.
    assert (by_chance < 0.5 * by_frames).all()
    grid = np.linspace(-0.4, 0.4, 41)
    centre = tails.mean(axis=0)
    for axis in range(2):
        shift = np.eye(2)[axis]
        profile = [exact_log_evidence(frames, centre + g * shift) for g in grid]
        assert abs(grid[np.argmax(profile)]) < by_frames[axis]
        step = 0.15
        second = (
            exact_log_evidence(frames, centre + step * shift)
            - 2 * exact_log_evidence(frames, centre)
            + exact_log_evidence(frames, centre - step * shift)
        ) / step**2
        # The inverse of one entry is the error with the other parameter known: a lower bound.
        assert by_frames[axis] > 0.8 * (-second) ** -0.5
