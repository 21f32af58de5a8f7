"""Baselines of the benchmarks: the usual OpenCV loops, and a filter for a single model."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

import scenes
from jaxpf.likelihoods.contours import EdgeDetector, contours
from jaxpf.likelihoods.contours.edges import brightness_gradient
from jaxpf.shapes.spaces import space_of
from jaxpf.shapes.splines import basis, fit_spline

#: Particles per pass of ``opencv_loop``.
LOOPED = 300
#: Measurement lines and samples per contour, and number of hypotheses.
LINES, SAMPLES, PARTICLES = 32, 41, 1000
_CLUTTER, _SIGMA, _THRESHOLD = 0.7, 7.0, 10.0


def opencv_loop(frame: np.ndarray, box: np.ndarray) -> Callable[[], None]:
    """The usual loop: calcHist and compareHist, particle by particle.

    One hue-saturation histogram of 110 bins without body parts: less work than our likelihood does.
    """
    import cv2

    cv2.setNumThreads(1)
    hsv = cv2.cvtColor(frame, cv2.COLOR_RGB2HSV)
    x, y, w, h = (round(value) for value in box)
    offsets = np.random.default_rng(1).normal(0, 4, (LOOPED, 2)).round().astype(int)

    def counted(left: int, top: int) -> np.ndarray:
        window = hsv[max(top, 0) : top + h, max(left, 0) : left + w]
        return cv2.calcHist([window], [0, 1], None, [11, 10], [0, 180, 0, 256])

    reference = counted(x, y)

    def loop() -> None:
        for right, down in offsets:
            counts = counted(x + right, y + down)
            np.exp(-20 * cv2.compareHist(reference, counts, cv2.HISTCMP_BHATTACHARYYA) ** 2)

    return loop


def contour_problem() -> tuple[Any, Any, np.ndarray]:
    """Likelihood of one leaf, a frame, and substates ``[6, N]`` around the truth."""
    scene = scenes.make("leaves", num_frames=2)
    control = [fit_spline(line, 10, closed=True) for line in scene.extras["outlines"][0, :1]]
    likelihood = contours(
        space_of("affine", np.array(control)),
        1,
        exclusion="none",
        clutter=_CLUTTER,
        detector=EdgeDetector(threshold=_THRESHOLD, length=SAMPLES),
        sigma=_SIGMA,
        num_lines=LINES,
    )
    substates = np.random.default_rng(0).normal(0, 3, (6, PARTICLES)).astype(np.float32)
    return likelihood, scene.frames[0], substates


def opencv_hypothesis(likelihood: Any, frame: np.ndarray) -> Callable[[np.ndarray], float]:
    """The log-likelihood ratio of one substate ``[6]``, as usually written.

    Two nearest-pixel calls of ``remap``, and vectors along the lines.
    """
    import cv2

    cv2.setNumThreads(1)
    gradient = np.asarray(brightness_gradient(jnp.asarray(frame), likelihood.detector.smoothing))
    places = np.arange(LINES) / LINES
    points = basis(places, 10, closed=True)
    slopes = basis(places, 10, closed=True, derivative=1)
    template, modes = (
        np.asarray(x, float)[0] for x in (likelihood.space.template, likelihood.space.modes)
    )
    steps = np.arange(-(SAMPLES // 2) - 1, SAMPLES // 2 + 2, dtype=np.float32)
    law = np.exp(-0.5 * (steps[1:-1] / _SIGMA) ** 2)
    law /= _SIGMA * np.sqrt(2 * np.pi)
    missed, found = 0.1, 0.9 * SAMPLES / _CLUTTER

    def hypothesis(substate: np.ndarray) -> float:
        control = template + np.tensordot(substate, modes, 1)
        middle, slope = points @ control, slopes @ control
        slope /= np.linalg.norm(slope, axis=1, keepdims=True)
        across, down = slope[:, 1:], -slope[:, :1]
        # OpenCV places pixel centres at integers.
        x = (middle[:, :1] + steps * across - 0.5).astype(np.float32)
        y = (middle[:, 1:] + steps * down - 0.5).astype(np.float32)
        in_x, in_y = (cv2.remap(g, x, y, cv2.INTER_NEAREST) for g in gradient)
        response = np.abs(in_x * across + in_y * down)
        here = response[:, 1:-1]
        is_feature = (here > _THRESHOLD) & (here >= response[:, :-2]) & (here > response[:, 2:])
        return float(np.log(missed + found * (is_feature @ law)).sum())

    return hypothesis


def minimal_filter(key: jax.Array, frames: jax.Array, num_particles: int) -> Any:
    """A bootstrap filter for a linear-Gaussian model only."""

    def step(carry, item):
        x, log_weights = carry
        time_, y = item
        resample_key, noise_key = jax.random.split(jax.random.fold_in(key, time_))
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
