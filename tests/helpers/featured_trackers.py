"""Linear-Gaussian models and trackers with the features of a configuration, and what is exact."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
from features import FACTORS

import jaxpf
from jaxpf import InputError, ordering, pytree_dataclass
from jaxpf.contract import CoupledDynamics, Proposal
from jaxpf.dynamics import IndependentGaussian, LinearGaussian
from jaxpf.filters import SideBySide, WithErrorBars
from jaxpf.gradients import StopGradient
from jaxpf.likelihoods import Gaussian

T, P, D, N = 3, 3, 2, 24
FLAT, TREE = (-1, -1, -1), (-1, 0, 0)


class MovesLabels:
    """Labels, 0 and 1, that change three times in ten."""

    def propagate_label(self, key, label, substates):
        return jnp.where(jax.random.uniform(key) < 0.3, 1 - label, label)

    def log_label(self, new, label, substates):
        return jnp.log(jnp.where(new == label, 0.7, 0.3))


@pytree_dataclass
class Coupled(CoupledDynamics):
    """Each object is drawn towards the next one."""

    noise: jax.Array

    def propagate(self, key, partition, current, previous, parent, others):
        moved = 0.6 * current + 0.2 * others[(partition + 1) % P]
        return moved + self.noise[partition, 0, 0] * jax.random.normal(key, current.shape)


@pytree_dataclass
class Varying:
    """Dynamics whose transition changes with time."""

    dynamics: LinearGaussian

    def at_frame(self, time):
        scale = jnp.asarray(PACE)[jnp.minimum(time, T)]
        its = self.dynamics
        return dataclasses.replace(its, transition=its.transition * scale)


@pytree_dataclass
class LinearWithLabels(MovesLabels, LinearGaussian):
    """Linear motion, and labels."""


@pytree_dataclass
class CoupledWithLabels(MovesLabels, Coupled):
    """Coupled motion, and labels."""


@pytree_dataclass
class Guess(Proposal):
    """Beside the dynamics, and wider."""

    scale: float = 1.5

    def propose(self, key, observation, partition, current, previous, parent):
        return 0.8 * current + 0.3 + self.scale * jax.random.normal(key, current.shape)

    def log_density(self, observation, partition, new, current, previous, parent):
        normal = jax.scipy.stats.norm.logpdf(new, 0.8 * current + 0.3, self.scale)
        return jnp.sum(normal)


@pytree_dataclass
class Sure(Gaussian):
    """Gaussian noise; objects are never lost, so that none jumps."""

    def log_odds(self, observation, partition, substate):
        return jnp.asarray(20.0, substate.dtype)


@pytree_dataclass
class Joint(Sure):
    """Noise that is correlated between partitions; each alone is weighed by its own."""

    def log_joint(self, observation, substates, log_probs, observed=None):
        seen = jnp.ones(P, bool) if observed is None else observed
        covariance = (
            jnp.where(seen[:, None] & seen, CORRELATED, jnp.eye(P)) * self.noise[0, 0, 0] ** 2
        )
        residual = jnp.where(seen[:, None], observation - substates, 0.0)
        log_normal = jax.vmap(jax.scipy.stats.multivariate_normal.logpdf, (1, None, None))
        unseen = (~seen).sum() * D * jnp.log(jnp.sqrt(2 * jnp.pi) * self.noise[0, 0, 0])
        return log_normal(residual, jnp.zeros(P), covariance).sum() + unseen


CORRELATED = 0.5 * np.eye(P) + 0.5
PACE = np.array([1.0, 0.4, 1.2, 0.7])
OBSERVED = np.ones((T, P), bool)
OBSERVED[1, 0] = False
FLIP = np.array([[0.7, 0.3], [0.3, 0.7]])
START_LABEL = np.array([0.2, 0.8])


def frames_of(config):
    frames = 1.5 * np.random.default_rng(0).normal(size=(T, P, D))
    if "missing frame" in config:
        frames[1] = np.nan
    return frames, OBSERVED if "missing partition" in config else None


def coefficients(config):
    """Transition, lag, coupling to the parent, and to the next object."""
    return (
        0.6 if {"second order", "coupled"} & set(config) else 0.8,
        0.3 if "second order" in config else 0.0,
        0.5 if "tree" in config else 0.0,
        0.2 if "coupled" in config else 0.0,
    )


def exact(config, factors=(1.0, 1.0), parts=range(P)):
    """Log evidence, and means and variances ``[T + 1, P, D]`` given all frames.

    ``factors`` multiply the noise of the motion and of the observations.
    """
    parts = list(parts)
    size = len(parts)
    own, lag, parental, next_one = coefficients(config)
    parents = np.zeros((size, size))
    for part, parent in enumerate(TREE if "tree" in config else ()):
        parents[part, max(parent, 0)] = parental * (parent >= 0)
    solve = np.linalg.inv(np.eye(size) - parents)
    noises = np.eye(size * (T + 2)).reshape(T + 2, size, -1)
    states = [noises[0], noises[0]]
    for t in range(T + 1):
        pace = PACE[t] if "time-varying" in config else 1.0
        matrix = own * pace * np.eye(size) + next_one * np.roll(np.eye(size), 1, axis=1)
        moved = matrix @ states[-1] + lag * states[-2] + factors[0] * noises[t + 1]
        states.append(solve @ moved)
    roots = np.concatenate(states[2:])  # [(T + 1) size, noises]
    frames, observed = frames_of(config)
    seen = np.isfinite(frames[..., 0]) & (True if observed is None else observed)
    joint = CORRELATED if {"joint", "joint weighting"} & set(config) else np.eye(P)
    noise = np.kron(np.eye(T), joint[np.ix_(parts, parts)]) * factors[1] ** 2
    seen = np.flatnonzero(seen[:, parts])
    prior = roots @ roots.T
    total = prior[np.ix_(seen, seen)] + noise[np.ix_(seen, seen)]
    y = frames[:, parts].reshape(-1, D)[seen]
    gain = prior[:, seen] @ np.linalg.inv(total)
    log_evidence = -0.5 * (
        np.sum(y * np.linalg.solve(total, y)) + D * np.linalg.slogdet(2 * np.pi * total)[1]
    )
    mean = (gain @ y).reshape(T + 1, size, D)
    variance = np.diagonal(prior - gain @ prior[seen]).reshape(T + 1, size, 1)
    return log_evidence, mean, variance


def model_of(config, factors=(1.0, 1.0)):
    own, lag, parental, _ = coefficients(config)
    blocks = np.broadcast_to(np.eye(D), (P, D, D))
    noise, seen_noise = factors[0] * blocks, factors[1] * blocks
    has_labels = "moving labels" in config
    if "coupled" in config:
        dynamics = (CoupledWithLabels if has_labels else Coupled)(jnp.asarray(noise))
    else:
        dynamics = (LinearWithLabels if has_labels else LinearGaussian)(
            own * blocks,
            noise,
            lag=lag * blocks if lag else None,
            coupling=parental * blocks if parental else None,
        )
    if "time-varying" in config:
        dynamics = Varying(dynamics)
    likelihood = (Joint if {"joint", "joint weighting"} & set(config) else Sure)(seen_noise)
    initial = IndependentGaussian(np.zeros((P, D)), 1.0)
    return {"dynamics": dynamics, "likelihood": likelihood, "initial": initial}


def tracker_of(config, num_particles=N):
    """The configuration's tracker; refuses as the library does."""
    config, model = set(config), model_of(config)
    settings = {"num_particles": num_particles, "resampling": "multinomial"}
    for level, name, value in (
        ("proposal", "proposal", Guess()),
        ("adaptive", "ess_threshold", 0.6),
        ("tempering", "tempering", 0.7),
        ("stop gradient", "gradient", StopGradient()),
        ("score", "gradient", StopGradient()),
        ("score", "motion_gradient", "score"),
        ("joint weighting", "joint_weighting", True),
        ("labels", "initial_label", START_LABEL),
        ("moving labels", "initial_label", START_LABEL),
        ("tree", "parents", TREE),
    ):
        if level in config:
            settings[name] = value
    parents = TREE if "tree" in config else FLAT
    orders = {
        "ps": lambda: ordering.ps([0, 2, 1]),
        "sir": lambda: ordering.sir(P),
        "dps": lambda: ordering.dps(P),
        "sps": lambda: ordering.sps(parents),
        "branched": lambda: ordering.branched([[0, 1, 2], [0, 2, 1]]),
    }
    others = {
        "labelled": lambda: jaxpf.Labelled(**model, **settings | {"weights": "corrected"}),
        "pffl": lambda: jaxpf.PFFL(**model, **settings),
        "eskil": lambda: jaxpf.Eskil(**model, shape="none", drift="clip", proper=True, **settings),
    }
    name = next(name for name in FACTORS["filter"] if name in config)
    if name in orders:
        made = jaxpf.Partitioned(**model, ordering=orders[name](), **settings)
    else:
        allowed = {"labelled": jaxpf.Labelled, "pffl": jaxpf.PFFL, "eskil": jaxpf.Eskil}[name]
        if unknown := settings.keys() - allowed.__dataclass_fields__.keys():
            raise InputError(f"{name} has no {sorted(unknown)}.")
        made = others[name]()
    if "error bars" in config:
        return WithErrorBars(made, lag=1)
    return SideBySide(made, 2) if "side by side" in config else made
