"""Labels on real numbers: exact by a Kalman filter for every sequence of labels.

Two targets move linearly.  A label, which moves by itself, says how strongly the noise of what is
seen of them hangs together; so their joint likelihood does not factor.
"""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from exact import LIMIT, monte_carlo, rauch_tung_striebel
from proposed import residual

import jaxpf
from jaxpf import ordering, pytree_dataclass
from jaxpf.contract.calls import changed_inside
from jaxpf.dynamics import RandomWalk
from jaxpf.gradients import StopGradient
from jaxpf.proposals import Linearised, Mixture

FRAMES, N, RUNS, FLIP = 3, 50, 20_000, 0.2
START_LABEL = (0.6, 0.4)
CORRELATIONS = np.array([0.0, 0.8])
SEEN = np.array([[0.4, 0.7], [1.2, -0.1], [1.0, -0.8]])
#: As if the noise was correlated in every other frame.
ALTERNATING = np.array([[2.0, 2.2], [0.2, 3.4], [2.2, 2.4]])


@pytree_dataclass
class Walk(RandomWalk):
    """A random walk of both, and a label that flips whatever they do."""

    flip: float = FLIP

    def propagate_label(self, key, label, substates):
        return jnp.where(jax.random.uniform(key) < self.flip, 1 - label, label)

    def log_label(self, new, label, substates):
        return jnp.log(jnp.where(new == label, 1 - self.flip, self.flip))


@pytree_dataclass
class Together:
    """Both positions with noise of variance 1, whose correlation is the label's."""

    def observe(self, frame):
        return frame

    def log_prob(self, observation, partition, substate):
        return -0.5 * (observation[partition] - substate[0]) ** 2

    def log_joint_labelled(self, observation, substates, log_probs, label):
        a, b = observation - substates[:, 0]
        rho = jnp.asarray(CORRELATIONS, a.dtype)[label]
        square = (a**2 - 2 * rho * a * b + b**2) / (1 - rho**2)
        return -0.5 * square - 0.5 * jnp.log1p(-(rho**2)) - np.log(2 * np.pi)


def exact(flip=FLIP, start=START_LABEL, frames=SEEN):
    """Evidence, label's and positions' expectations in the last frame, and all frames' smoothed."""
    total, is_one, places, smoothed = 0.0, 0.0, np.zeros(2), 0.0
    for labels in itertools.product((0, 1), repeat=FRAMES + 1):
        weight, mean, covariance = start[labels[0]], np.zeros(2), np.zeros((2, 2))
        means, covariances = [], []
        for before, label, seen in zip(labels, labels[1:], frames, strict=False):
            weight *= flip if before != label else 1 - flip
            covariance = covariance + np.eye(2)
            rho = CORRELATIONS[label]
            spread = covariance + np.array([[1, rho], [rho, 1]])
            off, gain = seen - mean, covariance @ np.linalg.inv(spread)
            weight *= np.exp(-0.5 * off @ np.linalg.solve(spread, off))
            weight /= 2 * np.pi * np.sqrt(np.linalg.det(spread))
            mean, covariance = mean + gain @ off, covariance - gain @ covariance
            means.append(mean)
            covariances.append(covariance)
        smoothed += weight * rauch_tung_striebel(np.eye(2), np.eye(2), means, covariances)[0]
        total += weight
        is_one += weight * labels[-1]
        places += weight * mean
    return total, is_one / total, places / total, smoothed / total


def report(state, summary):
    return summary.log_evidence, summary.estimate[:, 0], summary.label_probabilities[1]


def of_labels(**settings):
    return jaxpf.Partitioned(
        dynamics=Walk(1.0),
        likelihood=Together(),
        initial=np.zeros((2, 1), np.float32),
        initial_label=np.array(START_LABEL),
        **settings,
    )


@pytest.mark.statistical
@pytest.mark.slow
@pytest.mark.parametrize("name", ["sir", "ps", "branched", "joint", "proposed"])
def test_evidence_places_and_labels_are_unbiased(name):
    orders = {"sir": ordering.sir(2), "branched": ordering.branched([[0, 1], [1, 0]])}
    order = orders.get(name, ordering.ps([0, 1]))
    settings = {
        "joint": {"joint_weighting": True},
        "proposed": {"proposal": Mixture(Linearised(residual))},
    }
    tracker = of_labels(ordering=order, num_particles=N, **settings.get(name, {}))
    keys = jax.random.split(jax.random.key(2), RUNS)
    found = monte_carlo(tracker, keys, jnp.asarray(SEEN), record=report, batch_size=2000)
    log_evidence, places, is_one = (np.asarray(values, float) for values in found)
    evidence, true_label, true_places, _ = exact()
    scale = np.exp(log_evidence.sum(axis=1)) / evidence
    values = np.column_stack([scale, scale * is_one[:, -1], scale[:, None] * places[:, -1]])
    truth = np.array([1.0, true_label, *true_places])
    error = values.std(axis=0) / RUNS**0.5
    assert (error < 0.02 * np.maximum(np.abs(truth), 0.3)).all()  # 2% would be seen
    assert (np.abs(values.mean(axis=0) - truth) < LIMIT * error).all()


@pytest.mark.statistical
@pytest.mark.slow
def test_places_are_smoothed_together_with_their_labels():
    tracker = of_labels(ordering=ordering.ps([0, 1]), num_particles=600)
    keys = jax.random.split(jax.random.key(3), 60)

    def smoothed(key):
        return jaxpf.smooth(tracker, key, jnp.asarray(SEEN)).estimate[..., 0]

    found = np.asarray(jax.jit(lambda keys: jax.lax.map(smoothed, keys))(keys), float)
    error = found.std(axis=0) / len(found) ** 0.5
    assert (np.abs(found.mean(axis=0) - exact()[-1]) < LIMIT * error).all()


@pytest.mark.statistical
@pytest.mark.slow
@pytest.mark.parametrize("motion", [pytest.param("score", marks=pytest.mark.always), "pathwise"])
def test_gradient_by_the_law_of_the_labels_is_exact(motion):
    """By the probability of a flip, and by that of label 1 at first."""

    def evidence(flip, one):
        return exact(flip, (1 - one, one), ALTERNATING)[0]

    at, step = (FLIP, START_LABEL[1]), 1e-5 * np.eye(2)
    truth = np.array([evidence(*(at + d)) - evidence(*(at - d)) for d in step])
    truth /= 2e-5 * evidence(*at)

    def log_evidence(parameters, key):
        tracker = of_labels(
            ordering=ordering.ps([0, 1]),
            num_particles=20,
            gradient=StopGradient(),
            motion_gradient=motion,
        )
        tracker = changed_inside(tracker, "dynamics", lambda dynamics: Walk(1.0, parameters[0]))
        tracker = changed_inside(
            tracker, "initial_label", lambda label: jnp.stack([1 - parameters[1], parameters[1]])
        )
        return jaxpf.run(tracker, key, ALTERNATING)[1].log_evidence.sum()

    of_one = jax.value_and_grad(log_evidence)
    parameters = jnp.array(at)
    keys = jax.random.split(jax.random.key(4), RUNS)
    once = jax.jit(lambda keys: jax.lax.map(lambda k: of_one(parameters, k), keys, batch_size=1000))
    found, slopes = map(np.asarray, once(keys))
    values = np.exp(found)[:, None] / evidence(*at) * slopes
    error = values.std(axis=0) / RUNS**0.5
    assert (np.abs(values.mean(axis=0) - truth) < LIMIT * error).all()
    assert (6 * error < np.abs(truth)).all()  # a derivative that is left out would be seen
