"""The exact gradient of the evidence, and a filter's gradient of it, run by run.

Parameters are three factors, all 1: of the transition's coefficients, of the process noise and
of the observation noise.  Everything is in units of the exact evidence.
"""

import dataclasses
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from exact import COMPILER_OPTIONS, Problem

from jaxpf import tuning
from jaxpf.dynamics import IndependentGaussian
from jaxpf.likelihoods import kalman, stacked_model

NUM_PARTICLES = 64
RUNS = 20_000
BATCH = 1_000
PARAMETERS = ("coefficient", "process noise", "observation noise")


def scaled(model, factors):
    """Any object with ``dynamics`` and ``likelihood``: a tracker, or the exact problem."""
    dynamics, likelihood = model.dynamics, model.likelihood
    return {
        "dynamics": dataclasses.replace(
            dynamics, transition=dynamics.transition * factors[0], noise=dynamics.noise * factors[1]
        ),
        "likelihood": dataclasses.replace(likelihood, noise=likelihood.noise * factors[2]),
    }


def exact_gradient(exact: Problem) -> np.ndarray:
    """``[3]``: gradient of the log evidence, by central differences of the Kalman filter."""
    size = len(exact.parents)

    def log_evidence(factors):
        changed = scaled(exact, factors)
        start = np.zeros((2 * size, 2 * size))
        if isinstance(exact.initial, IndependentGaussian):
            start = np.kron(np.ones((2, 2)), np.eye(size)) * np.square(exact.initial.scale)
        increments = kalman(
            *stacked_model(changed["dynamics"], exact.parents),
            np.hstack([np.eye(size), np.zeros((size, size))]),
            np.eye(size) * np.asarray(changed["likelihood"].noise)[0, 0, 0] ** 2,
            np.zeros(2 * size),
            start,
            exact.frames[..., 0],
        )[0]
        return increments.sum()

    step = 1e-5 * np.eye(3)
    return np.array([(log_evidence(1 + s) - log_evidence(1 - s)) / 2e-5 for s in step])


class Gradients(NamedTuple):
    """Over runs: the evidence ``[R]`` and its gradient ``[R, 3]``, and the exact one ``[3]``."""

    evidence: np.ndarray
    gradient: np.ndarray
    exact: np.ndarray

    @property
    def bias(self) -> np.ndarray:
        """``[3]``: mean gradient less the exact one."""
        return self.gradient.mean(0) - self.exact

    @property
    def error(self) -> np.ndarray:
        """``[3]``: standard error of the bias."""
        return self.gradient.std(0) / len(self.gradient) ** 0.5

    @property
    def z(self) -> np.ndarray:
        """``[3]``: bias in standard errors."""
        return self.bias / self.error

    @property
    def worst(self) -> float:
        """The largest absolute z-score, of the evidence or its gradient."""
        of_evidence = (self.evidence.mean() - 1) / (self.evidence.std() / len(self.evidence) ** 0.5)
        scores = np.abs([of_evidence, *self.z])
        return float(np.nan_to_num(scores, nan=np.inf).max())

    def __str__(self) -> str:
        return ", ".join(
            f"{name} {exact:.3f}: bias {bias:+.3f} +- {error:.3f} (z {z:+.1f})"
            for name, exact, bias, error, z in zip(
                PARAMETERS, self.exact, self.bias, self.error, self.z, strict=True
            )
        )


def _log_evidence(factors, tracker, key, frames):
    changed = dataclasses.replace(tracker, **scaled(tracker, factors))
    return tuning.log_evidence(changed, key[None], frames, checkpoint=False)[0]


@partial(jax.jit, static_argnames="batch", compiler_options=COMPILER_OPTIONS)
def _every_gradient(tracker, keys, frames, batch):
    one = jax.value_and_grad(_log_evidence)

    def run(key):
        return one(jnp.ones(3), tracker, key, frames)

    return jax.lax.map(run, keys, batch_size=batch)


def gradients(exact: Problem, ordering, *, seed=1, runs=RUNS, batch=BATCH, **settings) -> Gradients:
    """Gradients of a filter's evidence estimate over many runs."""
    tracker = exact.tracker(ordering, **({"num_particles": NUM_PARTICLES} | settings))
    keys = jax.random.split(jax.random.key(seed), runs)
    log_evidence, gradient = _every_gradient(tracker, keys, exact.frames, batch)
    assert log_evidence.dtype == np.float64
    evidence = np.exp(np.asarray(log_evidence) - exact.log_evidence.sum())
    return Gradients(evidence, evidence[:, None] * np.asarray(gradient), exact_gradient(exact))
