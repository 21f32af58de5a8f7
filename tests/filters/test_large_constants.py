"""A constant in the log-likelihood changes the evidence alone, in float32 to the last bit.

Log-likelihoods are whole numbers, so that they are exact beside a constant of 1e7, where float32
holds nothing between whole numbers.
"""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from featured_trackers import MovesLabels
from proposed import Bad

import jaxpf
from jaxpf import gradients, ordering, pytree_dataclass
from jaxpf.contract import calls
from jaxpf.dynamics import RandomWalk
from jaxpf.filters import SideBySide, WithErrorBars
from jaxpf.lowering.derivatives import with_gradient_of

P, N, KEY = 3, 48, jax.random.key(2)
START = np.array([[4.0], [6.0], [8.0]], np.float32)
FRAMES = START + np.random.default_rng(0).normal(size=(3, P, 1)).astype(np.float32)
CONSTANTS = np.array([0, 1e3, 1e5, 1e6, 1e7], np.float32)
#: Partitions get different shares of the constant, and so do components at the same stage.
SHARES = np.array([1.0, -0.5, 0.25], np.float32)


@pytree_dataclass
class Whole:
    """Whole numbers, with the derivative of what has been rounded."""

    constant: Any = (0.0,) * P

    def observe(self, frame):
        return frame

    def log_prob(self, observation, partition, substate):
        value = -2 * jnp.sum((substate - observation[partition]) ** 2)
        whole = with_gradient_of(jax.lax.stop_gradient(jnp.round(value)), value)
        return whole + jnp.asarray(self.constant)[partition]


@pytree_dataclass
class Jointly(Whole):
    """Objects 0 and 1 exclude one another."""

    def log_joint(self, observation, substates, log_probs):
        near = jnp.abs(substates[0, 0] - substates[1, 0]) < 1
        return jnp.sum(log_probs) - 3 * near


@pytree_dataclass
class Flipping(MovesLabels, RandomWalk):
    """A random walk, and labels."""

    def predict(self, partition, current, previous):
        return current


def partitioned(order, likelihood=None, **options):
    likelihood = Whole() if likelihood is None else likelihood
    options = {"dynamics": RandomWalk(1.0), "num_particles": N} | options
    return jaxpf.Partitioned(likelihood=likelihood, ordering=order, initial=START, **options)


def labelled(weights="equal_share", likelihood=None, **options):
    likelihood = Whole() if likelihood is None else likelihood
    options = {"initial": START, "num_particles": N} | options
    return jaxpf.Labelled(RandomWalk(1.0), likelihood, weights=weights, **options)


def factored(kind, **options):
    return kind(RandomWalk(1.0), Whole(), START, num_particles=16, **options)


PS, TREE = ordering.ps([0, 1, 2]), (-1, 0, 0)
LABELS = {"dynamics": Flipping(1.0), "initial_label": np.full(2, 0.5)}
ADAPTIVE = {"proposal": Bad(), "ess_threshold": 0.5, "tempering": 0.7}
TRACKERS = {
    "sir": lambda: partitioned(ordering.sir(P)),
    "ps": lambda: partitioned(PS),
    "sps": lambda: partitioned(ordering.sps([-1] * P)),
    "sorted": lambda: partitioned(ordering.sps([-1] * P, swap="sorted")),
    "dps": lambda: partitioned(ordering.dps(P)),
    "literal": lambda: partitioned(ordering.dps(P, reassembly="literal")),
    "tree": lambda: partitioned(ordering.sps(TREE), parents=TREE),
    "adaptive": lambda: WithErrorBars(partitioned(PS, **ADAPTIVE)),
    "joint": lambda: partitioned(ordering.dps(P), Jointly()),
    "joint weighting": lambda: partitioned(PS, Jointly(), joint_weighting=True, **LABELS),
    "branched": lambda: partitioned(ordering.branched([[0, 1, 2], [2, 1, 0]]), **LABELS),
    "equal_share": labelled,
    "plain": lambda: labelled("plain"),
    "corrected": lambda: labelled("corrected"),
    "auxiliary": lambda: factored(jaxpf.PFFL),
    "pffl-literal": lambda: factored(jaxpf.PFFL, form="literal"),
    "eskil": lambda: factored(jaxpf.Eskil),
    "side-by-side": lambda: SideBySide(partitioned(PS), 3),
}
#: The first six share one program.
QUICK = "sir", "ps", "sps", "sorted", "dps", "literal", "equal_share", "auxiliary"


def with_constant(tracker, constant):
    def change(likelihood):
        # Targets of one mixture are compared, so that theirs is the same.
        shares = np.ones(P, np.float32) if isinstance(tracker, jaxpf.Labelled) else SHARES
        return dataclasses.replace(likelihood, constant=constant * shares)

    return calls.changed_inside(tracker, "likelihood", change)


@jax.jit
def runs(tracker):
    """One program for all constants: rounding is then the same."""
    return jax.lax.map(
        lambda constant: jaxpf.run(with_constant(tracker, constant), KEY, FRAMES), CONSTANTS
    )


def assert_same(values):
    values = np.asarray(values)
    np.testing.assert_array_equal(values, np.broadcast_to(values[:1], values.shape))


@pytest.mark.parametrize(
    "name", [pytest.param(x, marks=[pytest.mark.slow] * (x not in QUICK)) for x in TRACKERS]
)
def test_a_constant_changes_the_evidence_alone(name):
    tracker = TRACKERS[name]()
    states, summaries = runs(tracker)
    states = getattr(states, "state", getattr(states, "runs", states))
    assert_same(states.log_weights)
    np.testing.assert_allclose(np.exp(states.log_weights).sum(-1), 1, atol=1e-5)
    for field in ("estimate", "spread", "ess", "distinct_share", "status", "num_invalid"):
        assert_same(getattr(summaries, field))
    assert not np.any(summaries.status)
    if name == "eskil":  # has no evidence
        return
    # A mixture's evidence is that of one target, the others' that of all.
    share = 1 if isinstance(tracker, jaxpf.Labelled) else SHARES.sum()
    evidence = np.asarray(summaries.log_evidence, float)
    moved = evidence - share * CONSTANTS[:, None].astype(float)
    assert np.all(np.abs(moved - evidence[0]) <= 2 * np.spacing(CONSTANTS)[:, None] + 1e-5)


@jax.jit
def slopes(tracker):
    """Derivatives of the evidence and of the estimates in the noise."""

    def of_noise(noise, constant):
        changed = calls.changed_inside(tracker, "dynamics", lambda _: RandomWalk(noise))
        _, summaries = jaxpf.run(with_constant(changed, constant), KEY, FRAMES[:2])
        return jaxpf.log_evidence(summaries) + jnp.sum(summaries.estimate)

    return jax.lax.map(lambda constant: jax.grad(of_noise)(1.0, constant), CONSTANTS)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("gradient", "motion_gradient"),
    [
        (gradients.StopGradient(), "score"),
        (gradients.StopGradient(), "pathwise"),
        (gradients.NoGradient(), "pathwise"),
        (gradients.Soft(), "pathwise"),
        ("transport", "pathwise"),
    ],
)
def test_a_constant_changes_no_derivative(gradient, motion_gradient):
    if gradient == "transport":
        pytest.importorskip("ott", reason="needs jaxpf[transport]")
        gradient = gradients.Transport()
    found = slopes(partitioned(PS, gradient=gradient, motion_gradient=motion_gradient))
    assert abs(found[0]) > 0.1
    assert_same(found)


@pytest.mark.slow
def test_a_constant_changes_no_smoothed_estimate():
    """The likelihood sees the previous state: its factor joins the moves of the backward pass."""

    def likelihood(y, x, constant, previous):
        return jnp.round(-2 * (y - x) ** 2 - (x - previous) ** 2) + constant

    def smoothed(constant):
        return jaxpf.smooth(
            jaxpf.state_space(
                initial=jnp.float32(4),
                transition=lambda key, x, _: x + jax.random.normal(key),
                log_likelihood=likelihood,
                parameters=constant,
                transition_log_density=lambda new, x, _: -0.5 * (new - x) ** 2,
                num_particles=N,
            ),
            KEY,
            FRAMES[:, 0, 0],
        ).estimate

    found = jax.jit(lambda: jax.lax.map(smoothed, CONSTANTS))()
    assert np.ptp(found) > 0.1
    assert_same(found)
