"""An AR(1) seen in noise, whose two parameters have a posterior that a grid gives exactly."""

import jax
import jax.numpy as jnp
import numpy as np
import scipy.stats
from jax.scipy.stats import norm
from models import space

KEY = jax.random.key(3)
NOISE = 0.5
START = {"a": 0.5, "s": 1.0}


def made_frames():
    """An AR(1) seen in noise, one frame of which is missing."""
    rng = np.random.default_rng(1)
    x, y = 0.0, np.zeros(20)
    for t in range(20):
        x = 0.8 * x + 0.6 * rng.normal()
        y[t] = x + NOISE * rng.normal()
    y[7] = np.nan
    return y


FRAMES = made_frames()


def log_likelihood(y, x, p):
    return norm.logpdf(y, x, NOISE)


def observation(key, x, p):
    return x + NOISE * jax.random.normal(key)


def build(p):
    return space(
        log_likelihood=log_likelihood, observation=observation, parameters=p, num_particles=40
    )


def log_prior(p):
    """a in (-1, 1) uniform, s exponential: far from flat, so that it counts."""
    inside = (jnp.abs(p["a"]) < 1) & (p["s"] > 0)
    return jnp.where(inside, -3.0 * p["s"], -jnp.inf)


def exact_on_grid():
    """Grids of a and s; at every pair the log posterior, and a smoother's moments ``[T]``."""
    a, s = np.linspace(-1, 1, 161)[1:-1], np.linspace(0, 3, 181)[1:]
    step, noise = np.meshgrid(a, s, indexing="ij")
    mean, variance, log_posterior = 0 * noise, noise**2, -3 * noise
    filtered = []
    for y in FRAMES:
        mean, variance = step * mean, step**2 * variance + noise**2
        if np.isfinite(y):
            total = variance + NOISE**2
            log_posterior += scipy.stats.norm.logpdf(y, mean, total**0.5)
            mean = mean + variance / total * (y - mean)
            variance = variance * NOISE**2 / total
        filtered.append((mean, variance))
    smoothed = [filtered[-1]]
    for mean, variance in filtered[-2::-1]:
        predicted = step**2 * variance + noise**2
        gain = step * variance / predicted
        later = smoothed[-1]
        mean = mean + gain * (later[0] - step * mean)
        smoothed.append((mean, variance + gain**2 * (later[1] - predicted)))
    return a, s, log_posterior, smoothed[::-1]


def exact_margins():
    """Grids of a and s with their cumulative posteriors."""
    a, s, log_posterior, _ = exact_on_grid()
    weights = np.exp(log_posterior - log_posterior.max())
    for grid, axis in ((a, 1), (s, 0)):
        margin = weights.sum(axis)
        steps = np.concatenate([[0], np.cumsum((margin[1:] + margin[:-1]) / 2)])
        yield grid, steps / steps[-1]
