"""A linear-Gaussian model with varying inputs, whose every answer is known in closed form.

A state is pushed by p times one input, and seen beside another with a noise that varies too::

    x_t = A x_{t-1} + p push_t + S n,    y_t = x_t + lag x_{t-1} + offset_t + noise_t n

with ``x_0 = START n`` before the first frame.  Weights are far from equal, no two frames are alike,
and one frame is missing, so that faults of weights, of time and of gaps show.
"""

from typing import NamedTuple

import jax
import numpy as np
from jax.scipy.stats import norm

import jaxpf

A, S, START, LAG = 0.7, 0.5, 2.0, 1.0
INPUTS = {
    "push": np.array([2.0, -1.0, 4.0, 2.0, -3.0]),
    "offset": np.array([2.0, -3.0, 1.0, 4.0, -1.0]),
    "noise": np.array([0.8, 0.5, 0.7, 0.6, 0.9]),
}
FRAMES = np.array([4.4, -2.8, np.nan, 8.9, -2.6])
#: As likely with ``LAG`` as ``FRAMES`` are without.
FRAMES_OF_BOTH = np.array([5.3, -0.4, np.nan, 14.0, 3.9])
#: The prior of p is normal, and far from what the frames say.
PRIOR_MEAN, PRIOR_SCALE = -0.8, 0.27


def _start(key, p):
    return START * jax.random.normal(key)


def _transition(key, x, p, u):
    return A * x + p * u["push"] + S * jax.random.normal(key)


def _density(new, x, p, u):
    return norm.logpdf(new, A * x + p * u["push"], S)


def _log_likelihood(y, x, p, u):
    return norm.logpdf(y, x + u["offset"], u["noise"])


def _log_likelihood_of_both(y, x, p, u, previous):
    return norm.logpdf(y, x + LAG * previous + u["offset"], u["noise"])


def _observation(key, x, p, u):
    return x + u["offset"] + u["noise"] * jax.random.normal(key)


def model(p=1.0, *, looks_back=False, **settings):
    """The filter of a known p; with ``looks_back``, ``lag`` is ``LAG`` instead of 0."""
    settings = {"num_particles": 12, "resampling": "multinomial"} | settings
    return jaxpf.state_space(
        initial=_start,
        transition=_transition,
        transition_log_density=_density,
        log_likelihood=_log_likelihood_of_both if looks_back else _log_likelihood,
        observation=None if looks_back else _observation,
        parameters=p,
        **settings,
    )


def log_prior(p):
    return norm.logpdf(p, PRIOR_MEAN, PRIOR_SCALE)


def draw_prior(key):
    return PRIOR_MEAN + PRIOR_SCALE * jax.random.normal(key)


class Exact(NamedTuple):
    """Moments of ``(p, x_0, ..., x_T)`` given the frames, and the log evidence."""

    mean: np.ndarray
    covariance: np.ndarray
    log_evidence: float


def exact(p=None, *, lag=0.0, frames=FRAMES) -> Exact:
    """The answer given frames; p is unknown unless given."""
    rows, values, scales = [], [], []
    unit = np.eye(2 + len(frames))
    of_p, x = unit[0], unit[1:]

    def factor(row, value, scale):
        rows.append(row)
        values.append(value)
        scales.append(scale)

    factor(of_p, *((PRIOR_MEAN, PRIOR_SCALE) if p is None else (p, 1e-6)))
    factor(x[0], 0.0, START)
    for t, y in enumerate(frames):
        push, offset, noise = (INPUTS[name][t] for name in ("push", "offset", "noise"))
        factor(x[t + 1] - A * x[t] - push * of_p, 0.0, S)
        if np.isfinite(y):
            factor(x[t + 1] + lag * x[t], y - offset, noise)
    rows, values = np.array(rows) / np.array(scales)[:, None], np.array(values) / scales
    precision = rows.T @ rows
    covariance = np.linalg.inv(precision)
    mean = covariance @ rows.T @ values
    # All factors at the mean, times the volume of the normal around it.
    log_evidence = -0.5 * np.sum((values - rows @ mean) ** 2) - np.sum(np.log(scales))
    log_evidence += 0.5 * (len(mean) - len(rows)) * np.log(2 * np.pi)
    log_evidence -= 0.5 * np.linalg.slogdet(precision)[1]
    return Exact(mean, covariance, log_evidence)


def z_scores(samples, expected):
    """Distances of the means of independent ``samples``, in standard errors."""
    samples = np.asarray(samples, float)
    error = samples.std(0, ddof=1) / len(samples) ** 0.5
    return np.abs(samples.mean(0) - expected) / error
