"""Opaque targets under the filter: evidence and label posterior are those of enumeration."""

from itertools import product

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from three_steps import STEPS, ThreeSteps, opaque, square

from jaxpf import Partitioned, monte_carlo
from jaxpf.dynamics import WithOcclusion
from jaxpf.ordering import branched
from jaxpf.shapes import space_of

FLIP, RUNS, PARTICLES = 0.2, 600, 48
START = np.array([[0.0, 0.0], [0.0, 0.0]], np.float32)


def frames():
    """A square that comes out from behind another: the first one is in front."""
    found = np.full((2, 100, 160, 3), 210, np.uint8)
    for frame, shift in zip(found, (0, 6), strict=True):
        frame[30:70, 68 + shift : 108 + shift] = 140
        frame[30:70, 40:80] = 70
    return found


SPACE = space_of("translation", np.stack([square(60, 50), square(88, 50)]), degree=1)
LIKELIHOOD = opaque(SPACE, 2, num_lines=12)


@jax.jit
def log_joints(frame, substates, labels):
    return LIKELIHOOD.log_joint_labelled_all(LIKELIHOOD.observe(frame), substates, None, labels)


def enumerated():
    """Evidence of both frames, and the same times the probability of label 0 at the end."""
    overlap = jax.jit(jax.vmap(LIKELIHOOD.overlap, in_axes=-1))
    pairs = list(product(STEPS, STEPS))
    weights = {((0.0, 0.0), label): 0.5 for label in (0, 1)}
    for frame in frames():
        moved: dict = {}
        for (place, label), weight in weights.items():
            for pair in pairs:
                new = (place[0] + pair[0], place[1] + pair[1]), label
                moved[new] = moved.get(new, 0.0) + weight / len(pairs)
        places = sorted({place for place, _ in moved})
        substates = np.zeros((2, 2, len(places)), np.float32)
        substates[:, 0] = np.array(places).T
        are_over = np.asarray(overlap(substates))
        likely = [
            np.exp(np.asarray(log_joints(frame, substates, np.full(len(places), label)), float))
            for label in (0, 1)
        ]
        weights = {}
        for number, place in enumerate(places):
            flip = 0.0 if are_over[number] else FLIP
            before = [moved[place, label] for label in (0, 1)]
            for label in (0, 1):
                mixed = (1 - flip) * before[label] + flip * before[1 - label]
                weights[place, label] = mixed * likely[label][number]
    total = sum(weights.values())
    return total, sum(weight for (_, label), weight in weights.items() if label == 0)


@pytest.mark.slow
def test_evidence_and_label_posterior_are_those_of_enumeration():
    tracker = Partitioned(
        dynamics=WithOcclusion(ThreeSteps(), LIKELIHOOD, FLIP),
        likelihood=LIKELIHOOD,
        ordering=branched([[0, 1], [1, 0]]),
        initial=START,
        initial_label=np.full(2, 0.5, np.float32),
        num_particles=PARTICLES,
    )

    def keep(state, summary):
        return summary.log_evidence, summary.label_probabilities[0]

    keys = jax.random.split(jax.random.key(0), RUNS)
    found = monte_carlo(tracker, keys, jnp.asarray(frames()), keep, batch_size=100)
    log_evidence, first = (np.asarray(values, float) for values in found)
    evidence, of_first = enumerated()
    assert 0.6 < of_first / evidence < 0.999
    ratio = np.exp(log_evidence.sum(axis=1)) / evidence
    for values, expected in ((ratio, 1.0), (ratio * first[:, -1], of_first / evidence)):
        error = values.std(ddof=1) / np.sqrt(RUNS)
        assert error < 0.1
        assert abs(values.mean() - expected) < 4 * error
