"""Histogram likelihoods against the usual loop with OpenCV; the table is not included."""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from jaxpf.cli.benchmarks.problems import OBJECTS, crowded_frame
from jaxpf.cli.benchmarks.rows import Row, ahead_of, alone
from jaxpf.likelihoods.histogram import histogram
from jaxpf.measures.timing import interleaved

TITLE = "Histogram likelihood (table excluded)"
RUNS, PARTICLES = 50, 300
#: Particles of one pass of the loop.
LOOPED = 300


def opencv_loop(frame: np.ndarray, box: np.ndarray) -> Callable[[], None]:
    """The usual way: calcHist and compareHist for one particle after the other.

    One hue-saturation histogram of 110 bins and no parts: less work than ours does.
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


def rows(repeats: int) -> Iterator[Row]:
    """Integral and sampled histograms against the OpenCV loop."""
    frame, boxes = crowded_frame()
    centres = jnp.asarray([(x + w / 2, y + h / 2, 1.0) for x, y, w, h in boxes], jnp.float32)
    offsets = np.random.default_rng(2).normal(size=(RUNS, 3, PARTICLES)) * [[4], [4], [0.02]]
    noise = jnp.asarray(offsets, jnp.float32)
    candidates: dict[str, Callable[[], Any]] = {"opencv": opencv_loop(frame, boxes[0])}
    for method in ("integral", "sampled"):
        likelihood = histogram(frame, boxes, method=method)
        observation = jax.jit(likelihood.observe)(frame)

        @jax.jit
        def stages(observation, likelihood=likelihood):
            # As in the filter: stage after stage, so that memory is reused.
            def stage(j, total):
                partition = jnp.full(PARTICLES, j, jnp.int32)
                every = jax.vmap(likelihood.log_prob_all, in_axes=(None, None, 0))
                return total + every(observation, partition, centres[j][:, None] + noise)

            return lax.fori_loop(0, OBJECTS, stage, jnp.zeros((RUNS, PARTICLES)))

        candidates[method] = partial(stages, observation)
    seconds = interleaved(candidates, repeats)
    loop = seconds["opencv"] / LOOPED
    yield alone("OpenCV, a loop in Python", loop)
    queries = RUNS * PARTICLES * OBJECTS
    for method in ("integral", "sampled"):
        goal = ">= 100" if method == "integral" else ""
        yield ahead_of(f"histogram, {method}", seconds[method] / queries, loop, goal=goal)
