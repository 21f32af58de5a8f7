"""What the likelihood of a contour costs, beside the usual loop with OpenCV and NumPy."""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import scenes
from jaxpf.cli.benchmarks.rows import Row, ahead_of, alone
from jaxpf.likelihoods.contours import EdgeDetector, contours
from jaxpf.likelihoods.contours.edges import brightness_gradient
from jaxpf.measures.timing import interleaved
from jaxpf.shapes.spaces import space_of
from jaxpf.shapes.splines import basis, fit_spline

LINES, SAMPLES, PARTICLES = 32, 41, 1000
TITLE = (
    f"Contour likelihood: {LINES} lines of {SAMPLES} samples (gradient excluded; per hypothesis)"
)
_LOOPED = 200
_CLUTTER, _SIGMA, _THRESHOLD = 0.7, 7.0, 10.0


def problem() -> tuple[Any, Any, np.ndarray]:
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
    """The log-likelihood ratio of one substate ``[6]``, as it is usually written.

    Two calls of ``remap`` to the nearest pixel, and vectors along the lines.
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
        # OpenCV's pixels have their middles at whole numbers.
        x = (middle[:, :1] + steps * across - 0.5).astype(np.float32)
        y = (middle[:, 1:] + steps * down - 0.5).astype(np.float32)
        in_x, in_y = (cv2.remap(g, x, y, cv2.INTER_NEAREST) for g in gradient)
        response = np.abs(in_x * across + in_y * down)
        here = response[:, 1:-1]
        is_feature = (here > _THRESHOLD) & (here >= response[:, :-2]) & (here > response[:, 2:])
        return float(np.log(missed + found * (is_feature @ law)).sum())

    return hypothesis


def rows(repeats: int) -> Iterator[Row]:
    """One hypothesis of a contour, everything included but the frame's gradient."""
    likelihood, frame, substates = problem()
    hypothesis = opencv_hypothesis(likelihood, frame)

    def loop() -> None:
        for substate in substates.T[:_LOOPED]:
            hypothesis(substate)

    observation = jax.jit(likelihood.observe)(frame)
    partition = jnp.zeros(PARTICLES, jnp.int32)
    ours = partial(jax.jit(likelihood.log_prob_all), observation, partition, jnp.asarray(substates))
    seconds = interleaved({"opencv": loop, "ours": ours}, repeats)
    usual, own = seconds["opencv"] / _LOOPED, seconds["ours"] / PARTICLES
    yield alone("OpenCV's remap and NumPy, a loop", usual)
    yield ahead_of("contour likelihood", own, usual, goal=">= 2.5")
