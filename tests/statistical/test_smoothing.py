"""Smoothed means and variances against Rauch-Tung-Striebel, where it knows the answer."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from exact import COMPILER_OPTIONS, LIMIT, OBJECTS, TREE, objects, problem
from records import z_score

import jaxpf
from jaxpf import ordering
from jaxpf.proposals import LocallyOptimal

pytestmark = pytest.mark.statistical

RUNS, FRAMES = 40, 6
SIZES = (50, 800)
#: One motion of first order, one of second, and a tree, whose parts must be smoothed together.
CASES = {
    "ar1": (lambda: problem((-1, -1), num_frames=FRAMES), ordering.ps([1, 0])),
    "ar2": (lambda: objects(num_frames=FRAMES), ordering.dps(4)),
    "ar2-exchanged": (lambda: objects(num_frames=FRAMES), ordering.sps(OBJECTS)),
    "tree": (
        lambda: problem(TREE, lag=0.3, transition=0.6, num_frames=FRAMES),
        ordering.ps([0, 1, 2]),
    ),
    "tree-exchanged": (
        lambda: problem(TREE, num_frames=FRAMES),
        ordering.sps(TREE, "combinatorial"),
    ),
    "jointly-seen": (
        lambda: problem((-1, -1, -1), correlation=0.6, num_frames=FRAMES),
        ordering.ps([0, 1, 2]),
    ),
}


def smoothed_runs(tracker, frames, runs):
    """Estimates and second moments, ``[R, T, P]`` each."""

    def one(key):
        found = jaxpf.smooth(tracker, key, frames)
        mean = found.estimate[..., 0]
        return mean, mean**2 + found.spread[..., 0] ** 2, found.broken

    keys = jax.random.split(jax.random.key(3), runs)
    compiled = jax.jit(lambda keys: jax.lax.map(one, keys), compiler_options=COMPILER_OPTIONS)
    mean, second, broken = jax.tree.map(np.asarray, compiled(keys))
    assert not broken.any()
    return mean, second


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_smoothed_moments_converge_to_the_exact_ones(case):
    make, order = CASES[case]
    exact, errors = make(), []
    for size in SIZES:
        tracker = exact.tracker(order, num_particles=size)
        mean, second = smoothed_runs(tracker, exact.frames, RUNS)
        errors.append(np.sqrt(np.mean((mean - exact.smoothed_mean) ** 2)))
    slope = np.polyfit(np.log(SIZES), np.log(errors), 1)[0]
    of_mean = z_score(mean, exact.smoothed_mean)
    of_second = z_score(second, exact.smoothed_variance + exact.smoothed_mean**2)
    worst = max(of_mean.max(), of_second.max())
    print(f"{case}: slope {slope:.3f}, |z| up to {worst:.2f} of {of_mean.size * 2}")
    assert slope == pytest.approx(-0.5, abs=0.1)
    assert worst < LIMIT


@pytest.mark.slow
@pytest.mark.parametrize(
    ("make", "order"),
    [
        pytest.param(
            lambda: problem((-1,), transition=1.4, lag=-0.8, initial_scale=1.0),
            ordering.sir(1),
            id="second order",
            marks=pytest.mark.always,
        ),
        pytest.param(lambda: problem((-1, 0)), ordering.ps([0, 1]), id="tree"),
    ],
)
def test_three_frames_are_smoothed_exactly(make, order):
    exact = make()
    mean, second = smoothed_runs(exact.tracker(order, num_particles=300), exact.frames, RUNS)
    expected = exact.smoothed_variance + exact.smoothed_mean**2
    assert z_score(mean, exact.smoothed_mean).max() < LIMIT
    assert z_score(second, expected).max() < LIMIT


@pytest.mark.slow
@pytest.mark.parametrize(
    "proposal",
    [
        pytest.param(None, id="dynamics"),
        pytest.param(LocallyOptimal(), id="proposal", marks=pytest.mark.always),
    ],
)
def test_smoothing_sees_what_comes_after(proposal):
    exact = problem((-1,), num_frames=4)
    tracker = exact.tracker(ordering.sir(1), num_particles=200, proposal=proposal)
    mean, _ = smoothed_runs(tracker, exact.frames, 40)
    assert z_score(mean, exact.smoothed_mean).max() < LIMIT
    # The filter's own answer is another, of which this tells.
    assert z_score(mean, exact.mean)[:-1].max() > 10


@pytest.mark.slow
def test_a_lag_as_long_as_the_clip_is_the_whole_clip():
    exact = objects(num_frames=FRAMES)
    tracker = exact.tracker(ordering.ps([0, 1, 2, 3]), num_particles=100)
    key = jax.random.key(1)
    whole = jaxpf.smooth(tracker, key, exact.frames)
    lagged = jaxpf.smooth(tracker, key, exact.frames, lag=FRAMES)
    assert jnp.array_equal(lagged.summaries.estimate, whole.summaries.estimate)
    # Other draws from the same distribution, of 100 trajectories each.
    z = (lagged.estimate - whole.estimate) / (whole.spread * np.sqrt(2 / 100))
    assert np.abs(z).max() < LIMIT
