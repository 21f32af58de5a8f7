"""Missing frames: dynamics alone, no evidence, and nothing of what they hold gets anywhere."""

import functools

import jax
import jax.numpy as jnp
import models
import numpy as np
import pytest
from correlated import CorrelatedGaussian
from records import everything

import jaxpf
from jaxpf import InputError, ordering, pytree_dataclass
from jaxpf.dynamics import LinearGaussian
from jaxpf.filters import WithErrorBars
from jaxpf.likelihoods import Gaussian

KEY = jax.random.key(1)
SEEN = np.array([True, True, False, False, True])
FRAMES = np.random.default_rng(0).normal(size=(5, 3, 1)).astype(np.float32)
GAPS = np.where(SEEN[:, None, None], FRAMES, np.nan)


@pytree_dataclass
class Picky:
    """A user's likelihood, which a missing frame would break; ``poison`` tells where NaN got."""

    poison: jax.Array

    def observe(self, frame):
        return jnp.log(frame**2) * self.poison  # of zeros: minus infinity, with a NaN derivative

    def log_prob(self, observation, partition, substate):
        return -0.5 * (observation[partition, 0] - substate[0]) ** 2


partitioned = functools.partial(models.partitioned, num_particles=60)
CORRELATED = {"likelihood": CorrelatedGaussian(jnp.eye(3) / 2 + 0.5)}
TRACKERS = {
    "sir": partitioned(ordering.sir(3)),
    "literal-dps": partitioned(ordering.dps(3, reassembly="literal")),
    "sps": partitioned(ordering.sps([-1, -1, -1])),
    "sorted": partitioned(ordering.sps([-1, 0, 0], "sorted"), parents=(-1, 0, 0)),
    "tempered": partitioned(ordering.ps([0, 1, 2]), tempering=0.5),
    "adaptive": partitioned(ordering.ps([0, 1, 2]), ess_threshold=0.5),
    "joint": partitioned(ordering.ps([0, 1, 2]), **CORRELATED),
    "joint weighting": partitioned(ordering.ps([0, 1, 2]), **CORRELATED, joint_weighting=True),
    "error-bars": WithErrorBars(partitioned(ordering.ps([0, 1, 2]))),
    "labelled": jaxpf.Labelled(**models.walks(3), position=(0,)),
    "pffl": jaxpf.PFFL(**models.walks(3)),
}


def frames_for(name, frames):
    return frames[..., 0] if name in ("joint", "joint weighting") else frames


@functools.cache
def over_gaps(name):
    """States and summaries of all frames."""
    frames = frames_for(name, GAPS)
    return jax.device_get(jaxpf.run(TRACKERS[name], KEY, frames, everything)[1])


QUICK = "sir", "labelled", "pffl"


@pytest.mark.parametrize(
    "name", [pytest.param(x, marks=[pytest.mark.slow] * (x not in QUICK)) for x in TRACKERS]
)
def test_a_missing_frame_changes_no_weight_and_no_evidence(name):
    _, summary = over_gaps(name)
    assert (summary.log_evidence[~SEEN] == 0).all()
    assert np.isfinite(summary.log_evidence).all()
    assert (summary.log_evidence[SEEN] != 0).all()
    assert (summary.status == 0).all()
    assert np.isfinite(summary.estimate).all()
    # Particles have spread, by the noise of a random walk.
    assert (summary.spread[3] > summary.spread[1]).all()


@pytest.mark.parametrize(
    "name", ["sir", *(pytest.param(x, marks=pytest.mark.slow) for x in ("error-bars", "pffl"))]
)
def test_a_partition_may_be_missing_alone(name):
    """As if there were no likelihood of it; NaN in its place gets nowhere."""
    seen = np.ones((5, 3), bool)
    seen[2:4, 1] = False
    frames = np.where(seen[..., None], FRAMES, np.nan)
    summary = jaxpf.run(TRACKERS[name], KEY, frames, observed=seen)[1]
    assert np.isfinite(summary.estimate).all()
    assert (np.asarray(summary.log_evidence) != 0).all()
    assert (np.asarray(summary.status) == 0).all()
    spread = np.asarray(summary.spread)[..., 0]
    assert spread[3, 1] > 1.2 * spread[3, [0, 2]].max()


def test_a_joint_likelihood_may_say_what_a_missing_partition_means():
    @pytree_dataclass
    class Joint(CorrelatedGaussian):
        def log_joint(self, observation, substates, log_probs, observed=None):
            return jnp.sum(log_probs if observed is None else jnp.where(observed, log_probs, 0))

    seen = np.ones((5, 3), bool)
    seen[1, 0] = False
    its = partitioned(ordering.sir(3), likelihood=Joint(jnp.eye(3)))
    alone = TRACKERS["sir"]
    found = jaxpf.run(its, KEY, FRAMES[..., 0], observed=seen)[1]
    expected = jaxpf.run(alone, KEY, FRAMES, observed=seen)[1]
    np.testing.assert_allclose(found.log_evidence, expected.log_evidence, atol=1e-4)


@pytest.mark.parametrize("name", ["sir", pytest.param("labelled", marks=pytest.mark.slow)])
def test_a_forecast_is_a_run_over_frames_that_are_missing(name):
    states, expected = over_gaps(name)
    state = jax.tree.map(lambda x: x[1], states)  # two frames were tracked, two are missing
    _, ahead = jaxpf.forecast(TRACKERS[name], KEY, state, 2)
    np.testing.assert_allclose(ahead.estimate, expected.estimate[2:4], atol=1e-5)
    np.testing.assert_allclose(ahead.spread, expected.spread[2:4], atol=1e-5)
    assert (np.asarray(ahead.log_evidence) == 0).all()


@pytest.mark.statistical
@pytest.mark.slow
def test_a_forecast_has_the_moments_of_the_dynamics():
    """From an exact start: mean .9^k x, variance the sum of .81^j over j < k."""
    one = jnp.ones((2, 1, 1))
    its = jaxpf.Partitioned(
        dynamics=LinearGaussian(transition=0.9 * one, noise=one),
        likelihood=Gaussian(noise=one),
        ordering=ordering.ps([1, 0]),
        initial=jnp.array([[3.0], [-5.0]]),
        num_particles=20_000,
    )
    _, ahead = jaxpf.forecast(its, KEY, its.init(KEY), 4)
    steps = np.arange(1, 5)[:, None]
    variance = (1 - 0.81**steps) / (1 - 0.81)
    # Particles are independent: nothing was ever resampled by different weights.
    error = (ahead.estimate[..., 0] - 0.9**steps * [3.0, -5.0]) / np.sqrt(variance / 20_000)
    assert np.abs(error).max() < 4.5
    assert np.abs(ahead.spread[..., 0] ** 2 / variance - 1).max() < 4.5 * np.sqrt(2 / 20_000)


@pytest.mark.slow
def test_whole_numbers_are_missing_by_word_alone():
    frames = np.zeros((5, 3, 1), np.uint8)
    its = partitioned(ordering.ps([0, 1, 2]))
    summary = jaxpf.run(its, KEY, frames, observed=SEEN)[1]
    assert ((np.asarray(summary.log_evidence) == 0) == ~SEEN).all()


def test_without_gaps_nothing_changes():
    its, frames = of_pairs(of_both), jax.tree.map(np.nan_to_num, PAIRS)
    expected = jaxpf.run(its, KEY, frames)[1].estimate
    told = jaxpf.run(its, KEY, frames, observed=np.ones(5, bool))[1].estimate
    np.testing.assert_allclose(told, expected, atol=1e-5)


@pytest.mark.slow
@pytest.mark.always
def test_nothing_of_a_missing_frame_gets_into_a_derivative():
    frames = np.where(SEEN[:, None, None], FRAMES, 0.0).astype(np.float32)

    def evidence(poison):
        its = partitioned(ordering.ps([0, 1, 2]), likelihood=Picky(poison))
        return jnp.sum(jaxpf.run(its, KEY, frames, observed=SEEN)[1].log_evidence)

    value, slope = jax.jit(jax.value_and_grad(evidence))(jnp.float32(0.5))
    assert np.isfinite(value)
    assert np.isfinite(slope)
    assert slope != 0


@pytest.mark.parametrize(
    ("its", "observed", "sentence"),
    [
        (partitioned(ordering.sir(3)), np.ones(4, bool), "observed has shape"),
        (partitioned(ordering.sir(3)), np.ones((5, 2), bool), r"or which partitions, \[5, 3\]"),
        (TRACKERS["labelled"], np.ones((5, 3), bool), "compares particles of different targets"),
    ],
)
def test_what_says_nothing_of_frames_is_refused(its, observed, sentence):
    with pytest.raises(InputError, match=sentence):
        jaxpf.run(its, KEY, FRAMES, observed=observed)


# NaN in a part of a frame


def of_pairs(log_likelihood):
    return jaxpf.state_space(
        initial=np.zeros(2),
        transition=lambda key, x, p: x + jax.random.normal(key, (2,)),
        log_likelihood=log_likelihood,
        num_particles=50,
    )


def of_both(y, x, p):
    return -jnp.sum((y["a"] - x) ** 2) + 0 * y["b"]


PAIRS = {"a": np.random.default_rng(1).normal(size=(5, 2)), "b": np.zeros(5)}
PAIRS["a"][3, 1] = np.nan
PAIRS["b"][4] = np.nan


def test_nan_in_a_part_of_a_frame_is_refused_wherever_frames_are_known():
    its = of_pairs(of_both)
    whole = (
        r"frame 3 holds NaN\['a'\] at \[1\], but not only NaN; give observed= .* handles_nan = Tr"
    )
    one_by_one = [jax.tree.map(lambda x, i=i: x[i], PAIRS) for i in range(5)]
    for call in (
        lambda: jaxpf.run(its, KEY, PAIRS),
        lambda: jaxpf.monte_carlo(its, KEY[None], iter(one_by_one), frames_per_chunk=2),
        lambda: list(jaxpf.stream(its, KEY, one_by_one)),
    ):
        with pytest.raises(InputError, match=whole):
            call()
    seen = np.arange(5) < 3
    summary = jaxpf.run(its, KEY, PAIRS, observed=seen)[1]
    assert np.isfinite(summary.log_evidence).all()
    with pytest.raises(InputError, match=r"frame 4 holds NaN\['b'\] at \[\]"):
        jaxpf.run(its, KEY, PAIRS, observed=np.arange(5) != 3)


def test_a_likelihood_that_understands_nan_says_so():
    def of_what_is_there(y, x, p):
        there = ~jnp.isnan(y)
        return -jnp.sum(jnp.where(there, jnp.where(there, y, 0) - x, 0) ** 2)

    def without_a_word(y, x, p):
        return of_what_is_there(y, x, p)

    of_what_is_there.handles_nan = True
    summary = jaxpf.run(of_pairs(of_what_is_there), KEY, PAIRS["a"])[1]
    assert np.isfinite(summary.log_evidence).all()
    with pytest.raises(InputError, match=r"frame 3 holds NaN at \[1\]"):
        jaxpf.run(of_pairs(without_a_word), KEY, PAIRS["a"])


#: Frames that give all particles, or some of them, no number.
ALL, SOME = -1.0, -2.0


def troubled(y, x, p):
    likely = jnp.where(jnp.abs(y - x[0]) < 20, 0.0, -jnp.inf)
    return jnp.where((y == ALL) | ((y == SOME) & (x[0] > 0)), jnp.nan, likely)


@pytest.mark.parametrize(
    ("frames", "said"),
    [
        ([0.0, ALL, ALL], "frame 1 is NaN or .inf, and finite for no"),
        ([0.0, 1234.5, 1e6], "frame 1 .*1234.5"),
    ],
)
def test_a_frame_that_no_particle_explains_warns_once_with_what_it_holds(frames, said):
    its, frames = of_pairs(troubled), np.array(frames)
    for call in (
        lambda: jaxpf.run(its, KEY, frames)[1],
        lambda: jax.tree.map(lambda x: x[0], jaxpf.monte_carlo(its, KEY[None], frames)),
        lambda: jax.tree.map(
            lambda *x: np.stack(x), *(each.summary for each in jaxpf.stream(its, KEY, frames))
        ),
    ):
        with pytest.warns(UserWarning, match=said) as warned:
            summary = call()
        assert len(warned) == 1
        assert warned[0].filename == __file__
        np.testing.assert_array_equal(summary.ess[1:], 0)
        assert summary.ess[0] > 1


def test_a_likelihood_that_is_nan_for_some_particles_says_for_how_many():
    its, frames = of_pairs(troubled), np.array([0.0, SOME, 0.0])
    with pytest.warns(UserWarning, match="frame 1 is NaN or .inf [0-9]+ times") as warned:
        summary = jaxpf.run(its, KEY, frames)[1]
    assert len(warned) == 1
    assert 0 < summary.num_invalid[1] < its.num_particles
    assert f"{summary.num_invalid[1]} times" in str(warned[0].message)


def test_a_total_that_is_random_is_evidence_however_small():
    """Of ``Soft``: the mean of the weights of those drawn, about .01 here."""
    its = jaxpf.state_space(
        initial=lambda key, p: jax.random.normal(key),
        transition=lambda key, x, p: x + jax.random.normal(key),
        log_likelihood=lambda y, x, p: -0.1 * (y - x) ** 2,
        gradient=jaxpf.gradients.Soft(share=0.5),
        keep_ancestors=True,
        num_particles=50,
    )
    log_weights, sources, log_evidence = jaxpf.run(
        its, KEY, np.array([0.5, np.nan, np.nan]), keep_weights_and_sources
    )[1]
    for time in (1, 2):
        drawn = 50 * np.exp(log_weights[time - 1])[sources[time]]
        expected = np.log(np.mean(drawn / (0.5 * drawn + 0.5)))
        assert 1e-3 < abs(expected) < 0.1
        assert abs(log_evidence[time] - expected) < 1e-5


def keep_weights_and_sources(state, summary):
    return state.log_weights, state.sources[0], summary.log_evidence
