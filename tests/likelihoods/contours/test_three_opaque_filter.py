"""Three opaque targets under the filter: evidence and posterior of orders by enumeration."""

from itertools import permutations, product

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxpf import Partitioned, monte_carlo, pytree_dataclass
from jaxpf.dynamics import WithOcclusion
from jaxpf.likelihoods import EdgeDetector, contours
from jaxpf.ordering import branched
from jaxpf.shapes import space_of
from jaxpf.shapes.depth import depth_orders

FLIP, RUNS, PARTICLES, LIMIT = 0.3, 600, 120, 4.5
ORDERS = list(permutations(range(3)))
#: Squares move by one of three steps, so that everything about them can be enumerated.
STEPS = (-6.0, 0.0, 6.0)


@pytree_dataclass
class ThreeSteps:
    """A step left, none, or one right, as likely each."""

    def propagate(self, key, partition, current, previous, parent):
        return current.at[0].add(jax.random.choice(key, jnp.array(STEPS)))


def square(x, y, half=20.0):
    """Control points of a square, pixels."""
    corners = np.array([(-1, -1), (0, -1), (1, -1), (1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0)])
    return half * corners + np.array([x, y])


def opaque(space, num_targets, num_lines):
    """The likelihood of opaque squares."""
    return contours(
        space,
        num_targets,
        exclusion="opaque",
        clutter=0.5,
        detector=EdgeDetector(length=21),
        sigma=3.0,
        num_lines=num_lines,
        independence=0.15,
    )


def frames():
    """The first square hides a part of the second, and this a part of the third."""
    found = np.full((2, 100, 200, 3), 210, np.uint8)
    for frame, shift in zip(found, (0, 6), strict=True):
        frame[34:74, 108 + shift : 148 + shift] = 170
        frame[30:70, 72:112] = 120
        frame[26:66, 40:80] = 70
    return found


SPACE = space_of(
    "translation", np.stack([square(60, 46), square(92, 50), square(128, 54)]), degree=1
)
LIKELIHOOD = opaque(SPACE, 3, num_lines=8)


@jax.jit
def log_joints(frame, substates):
    """``[N, 6]``."""

    def one(label):
        labels = jnp.full(substates.shape[-1], label)
        observation = LIKELIHOOD.observe(frame)
        return LIKELIHOOD.log_joint_labelled_all(observation, substates, None, labels)

    return jax.lax.map(one, jnp.arange(6)).T


def moved_orders(weights, over):
    """Weights ``[6]`` of orders one frame on, by the rule in words; ``over`` tells of any pair."""
    found = np.zeros(6)
    for weight, order in zip(weights, ORDERS, strict=True):
        found[ORDERS.index(order)] += (1 - FLIP) * weight
        for place in (0, 1):
            there = list(order)
            if not over[order[place], order[place + 1]]:
                there[place : place + 2] = order[place + 1], order[place]
            found[ORDERS.index(tuple(there))] += FLIP / 2 * weight
    return found


def enumerated():
    """Evidence of both frames, and the same times the probabilities of the orders at the end."""
    overlap = jax.jit(jax.vmap(LIKELIHOOD.overlap, in_axes=(-1, None, None)))
    weights = {(0.0, 0.0, 0.0): np.full(6, 1 / 6)}
    for frame in frames():
        moved: dict = {}
        for place, of_orders in weights.items():
            for step in product(STEPS, repeat=3):
                new = tuple(np.add(place, step))
                moved[new] = moved.get(new, 0.0) + of_orders / 27
        substates = np.zeros((3, 2, len(moved)), np.float32)
        substates[:, 0] = np.array(list(moved)).T
        over = np.zeros((3, 3, len(moved)), bool)
        for one, other in permutations(range(3), 2):
            over[one, other] = overlap(substates, one, other)
        likely = np.exp(np.asarray(log_joints(frame, substates), float))
        weights = {
            place: moved_orders(of_orders, over[..., number]) * likely[number]
            for number, (place, of_orders) in enumerate(moved.items())
        }
    of_orders = np.sum(list(weights.values()), axis=0)
    return of_orders.sum(), of_orders


def runs(dynamics, orders, seed=0):
    """Log-evidence ``[R]`` of both frames, and label probabilities ``[R, 6]`` at the end."""
    tracker = Partitioned(
        dynamics=dynamics,
        likelihood=LIKELIHOOD,
        ordering=branched(orders),
        initial=np.zeros((3, 2), np.float32),
        initial_label=np.full(6, 1 / 6, np.float32),
        num_particles=PARTICLES,
    )

    def keep(state, summary):
        return summary.log_evidence, summary.label_probabilities

    keys = jax.random.split(jax.random.key(seed), RUNS)
    found = monte_carlo(tracker, keys, jnp.asarray(frames()), keep, batch_size=100)
    log_evidence, probabilities = (np.asarray(values, float) for values in found)
    return log_evidence.sum(axis=1), probabilities[:, -1]


def z_scores(log_evidence, probabilities):
    """Of the evidence and of each order's share of it, beside enumeration."""
    evidence, of_orders = enumerated()
    ratio = np.exp(log_evidence) / evidence
    values = np.concatenate([ratio[:, None], ratio[:, None] * probabilities], axis=1)
    error = values.std(axis=0, ddof=1) / np.sqrt(RUNS)
    assert error.max() < 0.1
    return (values.mean(axis=0) - np.append(1, of_orders / evidence)) / error


@pytest.mark.statistical
@pytest.mark.slow
def test_evidence_and_posterior_of_orders_are_those_of_enumeration():
    evidence, of_orders = enumerated()
    assert 0.2 < of_orders.max() / evidence < 0.99
    found = runs(WithOcclusion(ThreeSteps(), LIKELIHOOD, FLIP), depth_orders(3))
    assert np.abs(z_scores(*found)).max() < LIMIT


@pytree_dataclass
class WhoeverOverlaps(WithOcclusion):
    """A mutation: orders change between targets that overlap, too."""

    def _overlap(self, label, place, substates):
        return jnp.zeros((), bool)


@pytest.mark.statistical
@pytest.mark.slow
def test_kills_an_order_that_changes_between_those_that_overlap():
    found = runs(WhoeverOverlaps(ThreeSteps(), LIKELIHOOD, FLIP), depth_orders(3))
    assert np.abs(z_scores(*found)).max() > LIMIT
