"""Motion that changes with time, or couples partitions, against the Kalman filter."""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from exact import (
    COMPILER_OPTIONS,
    LIMIT,
    QUICK_RUNS,
    WRONG,
    Problem,
    monte_carlo_once,
    problem,
    record_runs,
    scores,
    scores_of,
)
from own_dynamics import Coupled, KnownCamera
from records import z_score

import jaxpf
from jaxpf import InputError, ordering, pytree_dataclass
from jaxpf.dynamics import RandomWalk
from jaxpf.likelihoods import Gaussian, kalman

pytestmark = pytest.mark.statistical

#: Every kernel here is of one test or two.
QUICK = {"runs": QUICK_RUNS, "run": monte_carlo_once}

#: How far a camera moved before each frame, and how long it took.
SHIFTS = np.array([[4.0], [-3.0], [7.0]])
STEPS = np.array([1, 3, 2])


@pytree_dataclass
class UnevenWalk:
    """A random walk of unit variance per step, ``steps[t]`` of them before frame t."""

    steps: Any
    step: Any = 1.0

    def at_frame(self, time):
        return dataclasses.replace(self, step=jnp.asarray(self.steps)[time])

    @property
    def walk(self):
        return RandomWalk(jnp.sqrt(self.step))

    def propagate_all(self, *arguments):
        return self.walk.propagate_all(*arguments)

    def log_density_all(self, *arguments):
        return self.walk.log_density_all(*arguments)


def behind_a_camera() -> Problem:
    """As ``problem``, all positions in the coordinates of a camera that moves."""
    still = problem((-1, -1), transition=1.0)
    path = np.cumsum(SHIFTS, axis=0)
    return still._replace(
        dynamics=KnownCamera(still.dynamics, SHIFTS),
        frames=still.frames + path[..., None],
        mean=still.mean + path,
        smoothed_mean=still.smoothed_mean + path,
    )


def unevenly_seen() -> Problem:
    """A walk of six steps of which the first, fourth and sixth are seen."""
    seen = np.cumsum(STEPS) - 1
    even = problem(
        (-1, -1), transition=1.0, num_frames=6, missing=sorted(set(range(6)) - set(seen.tolist()))
    )
    at_seen = {
        name: getattr(even, name)[seen]
        for name in Problem._fields
        if name not in ("dynamics", "likelihood", "parents", "initial")
    }
    return even._replace(dynamics=UnevenWalk(STEPS), **at_seen)


TIMED = {"camera": behind_a_camera, "uneven": unevenly_seen}


@pytest.mark.slow
@pytest.mark.parametrize("case", [pytest.param("camera", marks=pytest.mark.always), "uneven"])
def test_motion_that_changes_with_time_is_unbiased(case):
    exact = TIMED[case]()
    assert scores(exact, ordering.ps([1, 0]), **QUICK).worst < LIMIT


@pytest.mark.slow
@pytest.mark.always
def test_a_frame_too_early_is_noticed():
    exact = behind_a_camera()
    late = dataclasses.replace(
        exact.dynamics, shifts=np.roll(SHIFTS, 1, axis=0) / 4 + SHIFTS * 3 / 4
    )
    wrong = exact._replace(dynamics=late)
    assert scores(wrong, ordering.ps([1, 0]), **QUICK).worst > WRONG


@pytest.mark.slow
@pytest.mark.parametrize("lag", [None, 2])
@pytest.mark.parametrize("case", TIMED)
def test_smoothing_knows_the_time(case, lag):
    """Looking ahead by two frames at least is, of three, all that there is."""
    exact = TIMED[case]()
    tracker = exact.tracker(ordering.ps([0, 1]), num_particles=400)

    def one(key):
        found = jaxpf.smooth(tracker, key, exact.frames, lag=lag)
        return found.estimate[..., 0], found.broken

    keys = jax.random.split(jax.random.key(2), 40)
    if lag is None:
        compiled = jax.jit(lambda keys: jax.lax.map(one, keys), compiler_options=COMPILER_OPTIONS)
        mean, broken = compiled(keys)
    else:
        mean, broken = (np.stack(x) for x in zip(*map(one, keys), strict=True))
    assert not np.any(broken)
    assert z_score(np.asarray(mean), exact.smoothed_mean).max() < LIMIT


@pytest.mark.slow
def test_particle_gibbs_knows_the_time():
    """Means of a chain against the exact ones, by batches of sweeps."""
    exact = behind_a_camera()
    tracker = exact.tracker(ordering.ps([0, 1]), num_particles=16, resampling="multinomial")
    sweeps = jaxpf.smoothing.particle_gibbs(tracker, jax.random.key(4), exact.frames, 4200)
    batches = np.asarray(sweeps[200:, 1:, :, 0]).reshape(40, 100, 3, 2).mean(axis=1)
    assert z_score(batches, exact.smoothed_mean).max() < LIMIT


@pytest.mark.slow
def test_every_loop_over_frames_counts_them_alike():
    """One run, its halves, many runs, a stream and a forecast."""
    shifts, key = np.array([[4.0], [-3.0], [7.0], [20.0]]), jax.random.key(5)
    its = jaxpf.Partitioned(
        dynamics=KnownCamera(RandomWalk(0.1), shifts),
        likelihood=Gaussian(noise=np.ones((1, 1, 1))),
        ordering=ordering.sir(1),
        initial=np.zeros((1, 1)),
    )
    frames = np.cumsum(shifts, axis=0)[:, None]
    half, _ = jaxpf.run(its, key, frames[:2])
    _, rest = jaxpf.run(its, key, frames[2:], state=half)
    many = jaxpf.monte_carlo(its, key[None], frames).estimate[0]
    np.testing.assert_allclose(rest.estimate, many[2:], rtol=1e-9)
    streamed = jaxpf.stream(its, key, frames[2:], state=half)
    np.testing.assert_allclose([one.summary.estimate for one in streamed], many[2:], rtol=1e-9)
    ahead = jaxpf.forecast(its, key, half, 2)[1].estimate
    np.testing.assert_allclose(ahead - many[1], np.cumsum(shifts[2:], axis=0)[:, None], atol=0.2)


# All partitions of the frame before.


MATRIX = np.array([[0.5, 0.6, 0.0], [-0.4, 0.5, 0.5], [0.3, -0.3, 0.6]])


def coupled() -> Problem:
    """Three partitions, each of which moves by all of them."""
    alone = problem((-1, -1, -1))
    frames = alone.frames[..., 0]
    eye = np.eye(3)
    log_evidence, mean, posterior = kalman(
        MATRIX, eye, eye, eye, np.zeros(3), np.zeros((3, 3)), frames
    )
    return alone._replace(
        dynamics=Coupled(MATRIX),
        log_evidence=log_evidence,
        mean=mean,
        variance=np.diagonal(posterior, axis1=1, axis2=2),
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("order", "settings"),
    [
        pytest.param(ordering.ps([2, 0, 1]), {}, id="ps", marks=pytest.mark.always),
        pytest.param(ordering.dps(3), {}, id="dps"),
        pytest.param(ordering.ps([0, 1, 2]), {"ess_threshold": 0.5}, id="adaptive"),
    ],
)
def test_coupled_motion_is_unbiased(order, settings):
    assert scores(coupled(), order, **QUICK, **settings).worst < LIMIT


@pytest.mark.slow
@pytest.mark.always
def test_the_frame_before_is_that_of_the_same_particle():
    """With others' partitions of the frame before mixed up, the answer is wrong."""

    @pytree_dataclass
    class Mixed(Coupled):
        def propagate_all(self, key, partition, current, previous, parent, others):
            return super().propagate_all(
                key, partition, current, previous, parent, jnp.roll(others, 1, axis=-1)
            )

    exact = coupled()
    mixed = exact._replace(dynamics=Mixed(MATRIX))
    recorded = record_runs(mixed, ordering.ps([2, 0, 1]), **QUICK)
    assert scores_of(recorded, exact).worst > WRONG


def test_coupled_motion_is_refused_where_particles_hold_no_whole_states():
    exact, said = coupled(), "Coupled moves a partition by all the others"
    with pytest.raises(InputError, match=f"{said}.*swap='combinatorial'"):
        exact.tracker(ordering.sps([-1, -1, -1]))
    with pytest.raises(InputError, match=f"{said}.*motion_gradient"):
        exact.tracker(ordering.ps([0, 1, 2]), motion_gradient="score")
    with pytest.raises(InputError, match=f"{said}.*smoothing"):
        jaxpf.smooth(exact.tracker(ordering.sir(3)), jax.random.key(0), exact.frames)
    for kind in (jaxpf.PFFL, jaxpf.Labelled):
        with pytest.raises(InputError, match=said):
            kind(exact.dynamics, Gaussian(noise=jnp.ones((3, 1, 1))), initial=np.zeros((3, 1)))
