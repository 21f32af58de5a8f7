"""Independent linear-Gaussian targets for the labelled filter, and z-scores against Kalman.

Target l has its own evidence Z_l.  The labelled filter is one of a mixture whose components are
the targets, each with probability 1/L.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from exact import monte_carlo, objects, z

import jaxpf
from jaxpf.likelihoods import kalman

TARGETS, PARTICLES, RUNS, BATCH = 4, 48, 20_000, 2_000


class Targets(NamedTuple):
    """Model, frames ``[T, L, 1]``, and each target's exact answer in the last frame, ``[L]``."""

    problem: object
    log_evidence: np.ndarray
    mean: np.ndarray
    second: np.ndarray

    def tracker(self, **settings):
        settings = {"num_particles": PARTICLES} | settings
        return jaxpf.Labelled(
            dynamics=self.problem.dynamics,
            likelihood=self.problem.likelihood,
            initial=self.problem.initial,
            **settings,
        )


def targets(**changes) -> Targets:
    """Four targets, ``x_t = .7 x_{t-1} + .3 x_{t-2} + n``, observed with unit noise."""
    exact = objects(**changes)
    system = np.array([[0.7, 0.3], [1.0, 0.0]])
    process, seen, start = np.diag([1.0, 0.0]), np.array([[1.0, 0.0]]), np.ones((2, 2))
    log_evidence = [
        kalman(system, process, seen, np.eye(1), np.zeros(2), start, frames)[0].sum()
        for frames in np.swapaxes(exact.frames, 0, 1)
    ]
    assert np.isclose(sum(log_evidence), exact.log_evidence.sum())
    mean, variance = exact.mean[-1], exact.variance[-1]
    return Targets(exact, np.array(log_evidence), mean, variance + mean**2)


def moments(state, summary):
    """The one ``record`` of all tests here: evidence, and each label's share and moments."""
    weights = jnp.exp(state.log_weights)
    holds = state.labels == jnp.arange(state.log_mass.shape[-1])[:, None]
    values = state.lagged[0, 0]
    sums = (weights * holds) @ jnp.stack([jnp.ones_like(values), values, values**2], axis=-1)
    return (
        summary.log_evidence,
        summary.label_log_evidence,
        sums,
        holds.sum(-1),
        summary.without_likelihood,
    )


def recorded(exact: Targets, *, seed=1, runs=RUNS, batch=BATCH, **settings):
    """``moments`` of many runs, leading axes ``[R, T]``."""
    keys = jax.random.split(jax.random.key(seed), runs)
    tracker = exact.tracker(**settings)
    found = monte_carlo(tracker, keys, exact.problem.frames, record=moments, batch_size=batch)
    found = jax.tree.map(np.asarray, found)
    assert found[0].dtype == np.float64
    return found


def mass_scores(exact: Targets, found):
    """z-scores ``[3, L]`` of carried masses: ``L Z^ W_l / Z_l`` and with x and x^2."""
    log_evidence, _, sums, _, _ = found
    total = np.exp(log_evidence.sum(1))[:, None, None]
    ratio = TARGETS * total * sums[:, -1] / np.exp(exact.log_evidence)[:, None]
    answer = np.stack([np.ones(TARGETS), exact.mean, exact.second], axis=-1)
    return z(ratio, answer).T


def label_ratios(exact: Targets, found):
    """``[R, L]``: each label's own evidence estimate over Z_l."""
    return np.exp(found[1].sum(1) - exact.log_evidence)


def label_scores(exact: Targets, found):
    """z-scores ``[3, L]`` of each label's own evidence, and with x and x^2."""
    ratio = label_ratios(exact, found)[..., None]
    sums = found[2][:, -1]
    within = sums / np.maximum(sums[..., :1], np.finfo(float).tiny)
    answer = np.stack([np.ones(TARGETS), exact.mean, exact.second], axis=-1)
    return z(ratio * within, answer).T


def mixture_score(exact: Targets, found):
    """z-score of the evidence against ``(1/L) sum_l Z_l``."""
    answer = np.mean(np.exp(exact.log_evidence))
    return z(np.exp(found[0].sum(1)) / answer, 1.0)


def product_score(exact: Targets, found):
    """z-score of the product over labels of their own evidences, over the product of Z_l."""
    return z(np.prod(label_ratios(exact, found), axis=1), 1.0)
