"""Particle marginal Metropolis-Hastings against the exact posterior on a grid.

Quick tests compare it with a closed form in ``test_exact.py``.
"""

import dataclasses
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.special
import scipy.stats
from autoregression import FRAMES, KEY, NOISE, START, build, exact_margins, exact_on_grid, log_prior
from refusals import message_of

import jaxpf
from jaxpf import InputError, pytree_dataclass
from jaxpf.contract import Bias, static_field

CHAINS = 24


def drawn_by(num_particles, blocks):
    """With few particles: the evidence is noisy, and the chains' law is exact all the same."""
    return jaxpf.pmmh(
        build, log_prior, KEY, FRAMES, START,
        num_draws=800, num_warmup=300, num_chains=CHAINS,
        num_particles=num_particles, blocks=blocks, paths=True,
    )  # fmt: skip


@pytest.fixture(scope="module")
def posterior():
    return drawn_by(12, 10)


@pytest.mark.statistical
@pytest.mark.slow
@pytest.mark.parametrize("blocks", [1, pytest.param(10, marks=pytest.mark.always)])
def test_the_posterior_is_that_of_the_kalman_filter(posterior, blocks):
    """Distribution functions at 19 places, in standard errors over independent chains.

    In blocks the evidence of 12 particles would be too noisy, but for common random numbers.
    """
    if blocks == 1:
        posterior = drawn_by(25, blocks)
    for name, (grid, exact) in zip("as", exact_margins(), strict=True):
        draws = np.asarray(posterior.parameters[name])
        places = np.interp(np.linspace(0.05, 0.95, 19), exact, grid)
        shares = (draws[..., None] <= places).mean(1)  # [C, 19]
        errors = shares.std(0, ddof=1) / CHAINS**0.5
        distance = np.abs(shares.mean(0) - np.linspace(0.05, 0.95, 19))
        assert errors.max() < 0.035  # frozen random numbers would scatter the chains
        assert (distance / errors).max() < 4.5, name


@pytest.mark.statistical
@pytest.mark.slow
def test_paths_are_drawn_with_their_parameters(posterior):
    """Moments of states, the last of them times s, in standard errors over independent chains."""
    _, s, log_posterior, smoothed = exact_on_grid()
    weights = scipy.special.softmax(log_posterior)
    path, drawn_s = np.asarray(posterior.paths)[..., 0, 0], np.asarray(posterior.parameters["s"])
    of_chains = np.stack([path, path**2, path * drawn_s[..., None]]).mean(2)  # [3, C, T]
    exact = [[(weights * x).sum() for x in (m, m**2 + v, m * s)] for m, v in smoothed]
    errors = of_chains.std(1, ddof=1) / CHAINS**0.5
    assert errors.max() < 0.2
    assert np.abs((of_chains.mean(1).T - exact) / errors.T).max() < 4.5


@pytest.mark.statistical
@pytest.mark.slow
def test_observations_are_drawn_with_their_parameters(posterior):
    """Their moments, and the interval of the missing frame."""
    _, _, log_posterior, smoothed = exact_on_grid()
    weights = scipy.special.softmax(log_posterior)
    drawn = np.asarray(posterior.frames)
    of_chains = np.stack([drawn, drawn**2]).mean(2)  # [2, C, T]
    exact = [[(weights * x).sum() for x in (m, m**2 + v + NOISE**2)] for m, v in smoothed]
    errors = of_chains.std(1, ddof=1) / CHAINS**0.5
    assert np.abs((of_chains.mean(1).T - exact) / errors.T).max() < 4.5
    (mean, variance), ends = smoothed[7], np.stack(posterior.interval(0.95))[:, 7, None, None]

    def held(variance):
        low, high = scipy.stats.norm.cdf(ends, mean, variance**0.5)
        return ((high - low) * weights).sum()

    assert abs(held(variance) - 0.95) > 0.02  # of the state it is another
    assert abs(held(variance + NOISE**2) - 0.95) < 0.015


@pytest.fixture(scope="module")
def few():
    """Of a users' own ``jit``, which knows the shapes."""

    @jax.jit
    def draw(key, frames):
        return jaxpf.pmmh(
            build, log_prior, key, frames, START,
            num_draws=40, num_warmup=20, num_chains=3, num_particles=12, paths=True,
        )  # fmt: skip

    return draw(KEY, FRAMES)


def test_draws_keep_what_they_were_accepted_with(few):
    assert few.parameters["a"].shape == few.log_evidence.shape == (3, 40)
    assert few.num_particles == 12
    assert 0 < few.accepted.mean() < 0.8
    stayed = ~np.asarray(few.accepted)[:, 1:]
    for kept in (few.log_evidence, few.parameters["a"], few.paths[..., 5, 0, 0]):
        np.testing.assert_array_equal((np.diff(kept) == 0) & stayed, stayed)
    np.testing.assert_allclose(few.log_prior, -3 * np.asarray(few.parameters["s"]), rtol=1e-5)


def chosen_number(blocks):
    return jaxpf.pmmh(
        build, log_prior, KEY, FRAMES, START, num_draws=2, num_warmup=60, blocks=blocks
    ).num_particles


@pytest.mark.slow
def test_the_number_of_particles_makes_the_variance_of_the_evidence_about_one():
    middle = {"a": 0.6, "s": 0.6}
    tracker = jaxpf.tuning.replace(
        build(START), {f"parameters.{name}": value for name, value in middle.items()}
    )
    evidence = jaxpf.monte_carlo(tracker, jax.random.split(KEY, 200), FRAMES).log_evidence.sum(1)
    # Of 40 particles, and proportional to 1 / N; the chains are elsewhere.
    assert 0.3 < np.var(evidence) * 40 / chosen_number(1) < 3


@pytest.mark.slow
def test_fewer_particles_serve_in_blocks():
    """Most noise is common to both ends of a move."""
    assert chosen_number(10) < chosen_number(1)


@pytree_dataclass
class Noise:
    """A tracker whose evidence is N for every frame, and noise of variance ``variance / N``."""

    place: jax.Array
    variance: float = 0.0
    num_particles: int = static_field(default=8)
    evidence_biases: Any = static_field(default=())

    def init(self, key):
        return ()

    def step(self, key, state, frame):
        noise = jax.random.normal(key) * jnp.sqrt(self.variance / self.num_particles)
        summary = jaxpf.Summary(*[jnp.zeros(())] * 8)
        return (), dataclasses.replace(summary, log_evidence=self.num_particles + noise)


def noise_of(place, variance=8e-3):
    return Noise(place, variance)


def triangle(place):
    """A prior on (0, 1), proportional to the place."""
    return jnp.where((place > 0) & (place < 1), jnp.log(jnp.clip(place, 1e-9)), -jnp.inf)


def test_the_prior_alone_is_drawn_where_the_frames_say_nothing():
    """With noise from keys of its own for every evaluation, and so many particles as wanted."""
    chains = 200
    drawn = jaxpf.pmmh(
        noise_of, triangle, KEY, np.zeros(2, np.float32), 0.5,
        num_draws=40, num_warmup=200, num_chains=chains, num_particles=8,
    )  # fmt: skip
    accepted = np.asarray(drawn.accepted)
    evidence = np.asarray(drawn.log_evidence)
    np.testing.assert_allclose(evidence, 16, atol=0.3)  # two frames of 8 particles each
    assert len(np.unique(evidence[accepted])) > 0.9 * accepted.sum()
    place = np.asarray(drawn.parameters)
    assert ((place > 0) & (place < 1)).all()
    np.testing.assert_allclose(drawn.log_prior, np.log(place), rtol=1e-4)
    for power, exact in ((1, 2 / 3), (2, 1 / 2)):
        means = (place**power).mean(axis=1)
        assert abs(means.mean() - exact) < 4.5 * means.std(ddof=1) / chains**0.5


def test_no_more_particles_are_chosen_than_the_variance_wants():
    """A variance of 1 needs 28; the choice rounds up to half an octave."""
    loud = partial(noise_of, variance=28.0)
    drawn = jaxpf.pmmh(loud, triangle, KEY, np.zeros(1), 0.5, num_draws=2, num_warmup=20)
    assert 20 <= drawn.num_particles <= 45
    np.testing.assert_allclose(drawn.log_evidence, drawn.num_particles, atol=5)


def test_a_biased_evidence_is_refused_unless_it_is_asked_for():
    frames, few = np.zeros(1), {"num_draws": 2, "num_warmup": 2, "num_chains": 2}

    def biased(applies):
        return lambda p: Noise(p, evidence_biases=(Bias(applies, "swap='x'", "swap='y'"),))

    with pytest.raises(InputError, match="swap='x' biases it; use swap='y'"):
        jaxpf.pmmh(biased(True), triangle, KEY, frames, 0.5, **few)
    drawn = jaxpf.pmmh(biased(True), triangle, KEY, frames, 0.5, biased=True, **few)
    assert np.isfinite(drawn.parameters).all()


@pytest.mark.slow
def test_the_number_of_particles_in_a_users_jit_is_the_default():
    found = jax.eval_shape(
        lambda key, frames: jaxpf.pmmh(
            build, log_prior, key, frames, START, num_draws=3, num_warmup=2, num_chains=2
        ),
        KEY, FRAMES,
    )  # fmt: skip
    assert found.num_particles == 40


def test_the_draws_are_an_arviz_tree(few):
    pytest.importorskip("arviz_base", reason="pip install 'jaxpf[formats]'")
    tree = few.datatree()
    assert tree["posterior"]["a"].dims == ("chain", "draw")
    np.testing.assert_array_equal(tree["posterior"]["s"], few.parameters["s"])
    assert set(tree["sample_stats"].data_vars) == {"lp", "log_evidence", "accepted"}


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"initial": {"a": 2.0, "s": 1.0}}, "start"),
        ({"num_draws": 10**9}, "num_draws"),
        ({"num_particles": 0}, "num_particles"),
        ({"blocks": 0}, "blocks"),
    ],
)
def test_what_cannot_be_sampled_is_refused(changes, words):
    model = {"build": build, "log_prior": log_prior, "frames": FRAMES, "initial": START}
    assert words in message_of(jaxpf.pmmh, key=KEY, **model | changes)


def test_a_start_that_explains_no_frame_is_refused_for_a_given_number_of_particles():
    """Such chains never move; their draws would be the start."""
    few = {"num_draws": 2, "num_warmup": 2, "num_chains": 2, "num_particles": 4}
    with pytest.raises(InputError, match="4 particles"):
        jaxpf.pmmh(build, log_prior, KEY, np.full(3, 1e30, np.float32), START, **few)
