"""Baselines of the benchmarks: the usual OpenCV loop, and a filter for a single model."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

#: Particles per pass of ``opencv_loop``.
LOOPED = 300


def opencv_loop(frame: np.ndarray, box: np.ndarray) -> Callable[[], None]:
    """The usual loop: calcHist and compareHist, particle by particle.

    One hue-saturation histogram of 110 bins without body parts: less work than our likelihood does.
    """
    import cv2

    cv2.setNumThreads(1)
    hsv = cv2.cvtColor(frame, cv2.COLOR_RGB2HSV)
    x, y, w, h = (round(value) for value in box)
    offsets = np.random.default_rng(1).normal(0, 4, (LOOPED, 2)).round().astype(int)

    def histogram(left: int, top: int) -> np.ndarray:
        window = hsv[max(top, 0) : top + h, max(left, 0) : left + w]
        return cv2.calcHist([window], [0, 1], None, [11, 10], [0, 180, 0, 256])

    reference = histogram(x, y)

    def loop() -> None:
        for right, down in offsets:
            counts = histogram(x + right, y + down)
            np.exp(-20 * cv2.compareHist(reference, counts, cv2.HISTCMP_BHATTACHARYYA) ** 2)

    return loop


def minimal_filter(key: jax.Array, frames: jax.Array, num_particles: int) -> tuple[jax.Array, ...]:
    """A bootstrap filter written by hand for the model of ``measurements.generic``."""

    def step(carry, item):
        x, log_weights = carry
        time, y = item
        resample_key, noise_key = jax.random.split(jax.random.fold_in(key, time))
        weights = jnp.exp(log_weights - jnp.max(log_weights))
        total = lax.scan(lambda c, w: (c + w, c + w), jnp.zeros(()), weights)[1]
        offset = jax.random.uniform(resample_key)
        ends = jnp.ceil(num_particles * total / total[-1] - offset).astype(jnp.int32)
        counts = jnp.zeros(num_particles + 1, jnp.int32).at[ends].add(1, mode="drop")
        ancestors = lax.scan(
            lambda c, n: (c + n, c + n), jnp.zeros((), jnp.int32), counts[:num_particles]
        )[1]
        x = 0.9 * x[ancestors] + jax.random.normal(noise_key, (num_particles,))
        log_weights = -0.5 * (y - x) ** 2 - 0.5 * jnp.log(2 * jnp.pi)
        largest = jnp.max(log_weights)
        weights = jnp.exp(log_weights - largest)
        sum_ = jnp.sum(weights)
        report = (
            largest + jnp.log(sum_ / num_particles),
            jnp.sum(weights * x) / sum_,
            sum_**2 / jnp.sum(weights**2),
        )
        return (x, log_weights), report

    start = jnp.zeros(num_particles), jnp.zeros(num_particles)
    return lax.scan(step, start, (jnp.arange(frames.shape[0]), frames))[1]
