"""Smoothing and particle Gibbs against answers that are enumerated or known, in a few frames."""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from models import partitioned
from records import z_score
from refusals import message_of

import jaxpf
from jaxpf import ordering, pytree_dataclass
from jaxpf.smoothing import gibbs
from jaxpf.smoothing.checks import check_smoothing

LIMIT, KEY = 4.5, jax.random.key(0)
RNG = np.random.default_rng(2)


# --- Labels that move -----------------------------------------------------------------------

PLACES, FRAMES, FLIP = 3, 3, 0.2
#: Log-likelihoods ``[T, place, label]``.
JOINT = 1.5 * RNG.normal(size=(FRAMES, PLACES, 2))
STEP = np.array([[0.6, 0.3, 0.1], [0.2, 0.5, 0.3], [0.1, 0.2, 0.7]])


def place(substate):
    return substate[0].astype(int)


@pytree_dataclass
class Hops:
    """A chain on three places, and a label that flips."""

    def propagate(self, key, partition, current, previous, parent):
        to = jax.random.categorical(key, jnp.log(STEP)[place(current)])
        return to[None].astype(current.dtype)

    def log_density(self, partition, new, current, previous, parent):
        return jnp.log(STEP)[place(current), place(new)]

    def propagate_label(self, key, label, substates):
        return jnp.where(jax.random.uniform(key) < FLIP, 1 - label, label)

    def log_label(self, new, label, substates):
        return jnp.where(new == label, np.log(1 - FLIP), np.log(FLIP))


@pytree_dataclass
class OfLabels:
    """A frame is a table of log-likelihoods ``[place, label]``."""

    def observe(self, frame):
        return frame

    def log_prob(self, observation, partition, substate):
        return jnp.zeros((), substate.dtype)

    def log_joint_labelled(self, observation, substates, log_probs, label):
        return observation[place(substates[0]), label]


@pytest.mark.parametrize(
    "method", [pytest.param("backward", marks=[pytest.mark.slow, pytest.mark.always]), "metropolis"]
)
def test_smoothing_knows_that_labels_move(method):
    flip = np.array([[1 - FLIP, FLIP], [FLIP, 1 - FLIP]])
    move = np.kron(STEP, flip)  # over (place, label)
    seen = np.exp(JOINT).reshape(FRAMES, -1)
    start = np.zeros(2 * PLACES)
    start[:2] = 0.5
    weights = np.array(
        [
            (start @ move)[a] * seen[0, a] * move[a, b] * seen[1, b] * move[b, c] * seen[2, c]
            for a, b, c in itertools.product(range(2 * PLACES), repeat=3)
        ]
    ).reshape([2 * PLACES] * 3)
    weights /= weights.sum()
    marginals = [weights.sum(axis=(1, 2)), weights.sum(axis=(0, 2)), weights.sum(axis=(0, 1))]
    expected = np.array(marginals).reshape(3, PLACES, 2).sum(-1) @ np.arange(PLACES)
    its = jaxpf.Partitioned(
        dynamics=Hops(),
        likelihood=OfLabels(),
        ordering=ordering.sir(1),
        initial=np.zeros((1, 1), np.float32),
        initial_label=np.array([0.5, 0.5]),
        num_particles=1000,
        resampling="multinomial",
    )
    keys = jax.random.split(jax.random.key(0), 100)
    frames = jnp.asarray(JOINT, jnp.float32)

    def one(key):
        return jaxpf.smooth(its, key, frames, 200, method=method).estimate

    smooth = jax.jit(lambda keys: jax.lax.map(one, keys))
    estimates = np.asarray(smooth(keys), float)[..., 0, 0]
    assert z_score(estimates, expected).max() < LIMIT


@pytree_dataclass
class Together:
    """Coupled in every frame; all that it can do stands behind ``at_frame``."""

    def at_frame(self, time):
        return _Coupled()


@pytree_dataclass
class _Coupled(jaxpf.contract.CoupledDynamics):
    def propagate_all(self, key, partition, current, previous, parent, others):
        return current


def test_what_stands_behind_at_frame_is_refused_alike():
    exchanging = ordering.sps([-1, -1])
    assert "Together" in message_of(partitioned, exchanging, dynamics=Together())
    its = partitioned(dynamics=Together())
    assert "Together" in message_of(jaxpf.smooth, its, KEY, np.zeros((6, 2, 1)))


# --- Conditional sweeps ---------------------------------------------------------------------

#: Log-likelihoods ``[T, place]``, and probabilities of a place given the two before.
SEEN = RNG.normal(size=(4, 2))
NEXT = RNG.dirichlet([0.7, 0.7], size=(2, 2))  # [previous, current, new]


@pytree_dataclass
class SecondOrder:
    """A chain on two places that remembers two."""

    def propagate(self, key, partition, current, previous, parent):
        to = jax.random.categorical(key, jnp.log(NEXT)[place(previous), place(current)])
        return to[None].astype(current.dtype)

    def log_density(self, partition, new, current, previous, parent):
        return jnp.log(NEXT)[place(previous), place(current), place(new)]


@pytree_dataclass
class OfPlaces:
    """A frame is a table of log-likelihoods ``[place]``."""

    def observe(self, frame):
        return frame

    def log_prob(self, observation, partition, substate):
        return observation[place(substate)]


@pytest.mark.slow
@pytest.mark.always
def test_a_conditional_sweep_leaves_the_posterior_of_trajectories_as_it_is():
    paths = np.array([*itertools.product(range(2), repeat=4)])
    posterior = np.ones(len(paths))
    for number, path in enumerate(paths):
        previous = current = 0
        for time, new in enumerate(path):
            posterior[number] *= NEXT[previous, current, new] * np.exp(SEEN[time, new])
            previous, current = current, new
    posterior /= posterior.sum()
    its = jaxpf.Partitioned(
        dynamics=SecondOrder(),
        likelihood=OfPlaces(),
        ordering=ordering.sir(1),
        initial=np.zeros((1, 1), np.float32),
        num_particles=3,
        resampling="multinomial",
    )
    check_smoothing(its)
    runs = 40_000
    drawn = np.random.default_rng(3).choice(len(paths), runs, p=posterior)
    references = np.pad(paths[drawn], ((0, 0), (1, 0)))[..., None, None].astype(np.float32)
    frames = jnp.asarray(SEEN, jnp.float32)
    sweep = jax.jit(jax.vmap(lambda key, reference: gibbs.sweep(its, key, frames, reference, True)))
    swept = np.asarray(sweep(jax.random.split(jax.random.key(0), runs), references))
    number = swept[:, 1:, 0, 0].astype(int) @ [8, 4, 2, 1]
    frequency = np.bincount(number, minlength=len(paths)) / runs
    error = np.sqrt(posterior * (1 - posterior) / runs)
    assert np.abs((frequency - posterior) / error).max() < LIMIT
    assert (number != drawn).mean() > 0.3  # and it moves
