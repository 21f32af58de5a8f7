"""What a proposal goes with: each combination works, or is refused in one sentence.

Those that work are compared with the Kalman filter in tests/statistical/test_proposals.py.
"""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from correlated import CorrelatedGaussian
from proposed import residual
from refusals import message_of
from scipy.stats import multivariate_normal
from unsuited_dynamics import Coupled

import jaxpf
from jaxpf import gradients, ordering, pytree_dataclass
from jaxpf.dynamics import LinearGaussian, RandomWalk
from jaxpf.filters import SideBySide, WithErrorBars
from jaxpf.likelihoods import Gaussian
from jaxpf.proposals import Linearised, LocallyOptimal, Mixture

P, KEY = 3, jax.random.key(0)
FRAMES = np.zeros((4, P, 1), np.float32)
SEEN = np.array([True, False, True, True])


@pytree_dataclass
class Guess(jaxpf.contract.Proposal):
    """Draws at the observation."""

    def propose(self, key, observation, partition, current, previous, parent):
        return observation[partition] + jax.random.normal(key, current.shape)

    def log_density(self, observation, partition, new, current, previous, parent):
        return jax.scipy.stats.norm.logpdf(new - observation[partition]).sum()


MOVES = LinearGaussian(transition=0.8 * np.ones((P, 1, 1)), noise=np.ones((P, 1, 1)))
SEES = Gaussian(noise=np.ones((P, 1, 1)))


def tracker(order=None, **changes):
    settings = {
        "dynamics": MOVES,
        "likelihood": SEES,
        "initial": np.zeros((P, 1), np.float32),
        "num_particles": 30,
        "proposal": Mixture(LocallyOptimal()),
    }
    settings["ordering"] = ordering.ps(range(P)) if order is None else order
    return jaxpf.Partitioned(**(settings | changes))


def run(tracker, **options):
    return jaxpf.run(tracker, KEY, FRAMES, **options)


def smooth(tracker, **options):
    return jaxpf.smooth(tracker, KEY, FRAMES, 5, **options)


def evidence_gradient(tracker):
    def log_evidence(share):
        changed = jaxpf.tuning.replace(tracker, {"proposal.share": share})
        return run(changed)[1].log_evidence.sum()

    return jax.grad(log_evidence)(0.5)


LABELS = {"initial_label": np.array([0.5, 0.5])}
TREE = {"parents": (-1, 0, 0)}
#: Combination -> tracker, what is done with it, and the refusal; None works.
TABLE = {
    "sir": (lambda: tracker(ordering.sir(P)), run, None),
    "ps": (lambda: tracker(), run, None),
    "dps": (lambda: tracker(ordering.dps(P)), run, None),
    "branched, by labels": (
        lambda: tracker(ordering.branched([[0, 1, 2], [2, 1, 0]]), **LABELS), run, None,
    ),
    "exchange": (lambda: tracker(ordering.sps(num_partitions=P)), run, None),
    "exchange on a tree": (lambda: tracker(ordering.sps((-1, 0, 0)), **TREE), run, None),
    "levels without exchange": (
        lambda: tracker(ordering.sps(num_partitions=P, swap="none")), run, None,
    ),
    "missing frames": (tracker, lambda its: run(its, observed=SEEN), None),
    "missing partitions": (
        tracker, lambda its: run(its, observed=np.outer(SEEN, [True, False, True])), None,
    ),
    "forecast": (
        tracker, lambda its: jaxpf.forecast(its, KEY, its.init(KEY), 2), None,
    ),
    "labels": (lambda: tracker(**LABELS), run, None),
    "joint likelihood": (
        lambda: tracker(
            likelihood=CorrelatedGaussian(np.eye(P)), proposal=Mixture(Linearised(residual))
        ),
        lambda its: jaxpf.run(its, KEY, FRAMES[..., 0]),
        None,
    ),
    "own proposal": (lambda: tracker(proposal=Guess()), run, None),
    "linearised": (lambda: tracker(proposal=Linearised(residual)), run, None),
    "tempering": (lambda: tracker(tempering=0.5), run, None),
    "resampling now and then": (lambda: tracker(ess_threshold=0.5), run, None),
    "smoothing": (tracker, smooth, None),
    "smoothing over a gap": (tracker, lambda its: smooth(its, observed=SEEN), None),
    "smoothing after exchange": (lambda: tracker(ordering.sps(num_partitions=P)), smooth, None),
    "particle Gibbs": (
        lambda: tracker(resampling="multinomial"),
        lambda its: jaxpf.smoothing.particle_gibbs(its, KEY, FRAMES, 2),
        None,
    ),
    "error bars": (lambda: WithErrorBars(tracker(), lag=2), run, None),
    "runs side by side": (lambda: SideBySide(tracker(), num_runs=3), run, None),
    "plain gradient": (tracker, evidence_gradient, None),
    "gradient through resampling": (
        lambda: tracker(gradient=gradients.StopGradient()), evidence_gradient, None,
    ),
    "soft resampling": (lambda: tracker(gradient=gradients.Soft(0.5)), evidence_gradient, None),
    "transport": (
        lambda: tracker(ordering.sir(P), gradient=gradients.Transport()), evidence_gradient, None,
    ),
    "score of the motion": (
        lambda: tracker(gradient=gradients.StopGradient(), motion_gradient="score"),
        evidence_gradient,
        None,
    ),
    "many runs": (
        tracker, lambda its: jaxpf.monte_carlo(its, jax.random.split(KEY, 3), FRAMES), None,
    ),
    "coupled dynamics": (
        lambda: tracker(dynamics=Coupled()), run, "Coupled",
    ),
}  # fmt: skip
SLOW_TO_TRACE = {
    "plain gradient", "gradient through resampling", "soft resampling", "transport", "many runs",
    "runs side by side", "score of the motion", "smoothing over a gap", "smoothing after exchange",
}  # fmt: skip


@pytest.mark.parametrize(
    "case",
    [pytest.param(case, marks=[pytest.mark.slow] * (case in SLOW_TO_TRACE)) for case in TABLE],
)
def test_a_proposal_works_or_is_refused(case):
    """Traced alone, which is quick."""
    make, use, refusal = TABLE[case]
    if refusal is None:
        jax.eval_shape(lambda: use(make()))
        return
    assert refusal in message_of(jax.eval_shape, lambda: use(make()))


# Time, inputs and parameters

INPUTS = np.float32([1.0, -2.0, 4.0, 3.0])
Y = np.float32([1.5, 0.3, 2.0, 3.3])
normal = jax.scipy.stats.norm.logpdf


def noise_at(time):
    """Standard deviation of the observation."""
    return 0.5 + 0.5 * time


@pytree_dataclass
class Optimal(jaxpf.contract.Proposal):
    """Of ``x_t = p u_t + n`` and an observation whose noise grows with time."""

    inputs: Any = None
    moment: Any = None
    parameters: Any = None

    def with_inputs(self, inputs, first):
        return dataclasses.replace(self, inputs=(inputs, first))

    def at_frame(self, time):
        values, first = self.inputs
        return dataclasses.replace(self, moment=(time, jnp.asarray(values)[time - first]))

    def of_model(self, dynamics, likelihood):
        return dataclasses.replace(self, parameters=dynamics.parameters)

    def moments(self, observation):
        time, u = self.moment
        gain = 1 / (1 + noise_at(time) ** 2)
        mean = self.parameters * u
        return mean + gain * (observation - mean), jnp.sqrt(1 - gain)

    def propose(self, key, observation, partition, current, previous, parent):
        mean, scale = self.moments(observation)
        return mean + scale * jax.random.normal(key, current.shape)

    def log_density(self, observation, partition, new, current, previous, parent):
        return normal(new[0], *self.moments(observation))


def sees(y, x, p, time):
    return normal(y, x, noise_at(time))


def sees_both(y, x, p, time, previous):
    return sees(y, x, p, time) + 0 * previous


@pytest.mark.parametrize(
    ("log_likelihood", "wrapped"),
    [
        (sees, lambda x: Mixture(x, share=0.9999)),
        (sees_both, lambda x: x),
        pytest.param(sees, lambda x: x, marks=pytest.mark.slow),
        pytest.param(sees_both, lambda x: Mixture(x, share=0.9999), marks=pytest.mark.slow),
    ],
)
def test_a_proposal_receives_time_inputs_and_parameters(log_likelihood, wrapped):
    """The optimal one of states that forget their past: all particles get the exact evidence."""
    its = jaxpf.state_space(
        initial=0.0,
        transition=lambda key, x, p, u: p * u + jax.random.normal(key),
        transition_log_density=lambda new, x, p, u: normal(new, p * u),
        log_likelihood=log_likelihood,
        parameters=0.7,
        num_particles=20,
        proposal=wrapped(Optimal()),
    )
    changed = jaxpf.tuning.replace(its, {"parameters": 0.8})
    state, _ = jaxpf.run(changed, KEY, Y[:1], inputs=INPUTS[:1])
    summary = jaxpf.run(changed, KEY, Y[1:], inputs=INPUTS[1:], state=state)[1]
    exact = normal(Y, 0.8 * INPUTS, np.sqrt(1 + noise_at(np.arange(4)) ** 2))[1:]
    np.testing.assert_allclose(summary.log_evidence, exact, atol=1e-3)
    np.testing.assert_allclose(summary.ess, 20, rtol=1e-3)


def test_the_density_of_a_mixture_is_that_of_both():
    """Of the optimal normal in two correlated dimensions, and of the walk beside it."""
    root, scale = np.array([[0.5, 0.0], [0.4, 0.3]]), np.array([1.0, 2.0])
    likelihood = Gaussian(noise=root[None])
    walk, frame, past = RandomWalk(scale), np.array([[1.5, -0.5]]), np.array([0.3, -1.0])
    mixture = Mixture(LocallyOptimal(), 0.7)
    mixture = mixture.of_model(walk, likelihood)
    new = np.random.default_rng(0).normal([1.0, -0.5], size=(6, 2))
    column = jnp.repeat(jnp.asarray(past)[:, None], 6, axis=1)
    found = jax.jit(mixture.log_density_all)(
        frame, jnp.zeros(6, jnp.int32), jnp.asarray(new.T), column, column, 0 * column
    )
    before, seen = np.diag(1 / scale**2), np.linalg.inv(root @ root.T)
    covariance = np.linalg.inv(before + seen)
    optimal = multivariate_normal(covariance @ (before @ past + seen @ frame[0]), covariance)
    moved = multivariate_normal(past, np.diag(scale**2))
    expected = np.log(0.7 * optimal.pdf(new) + 0.3 * moved.pdf(new))
    np.testing.assert_allclose(found, expected, rtol=1e-3, atol=1e-3)
