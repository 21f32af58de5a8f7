"""Benchmark problems: crowded frames, and a 1-D model."""

from typing import Any

import jax.numpy as jnp
import numpy as np

import jaxpf
from jaxpf import ordering as orderings
from jaxpf.boxes.models import box_model
from jaxpf.dynamics.gaussian import LinearGaussian
from jaxpf.likelihoods.gaussian import Gaussian
from jaxpf.tuning import objectives

OBJECTS, HEIGHT, WIDTH = 7, 288, 360
#: Noise of u, v (pixels) and of the scale in all benchmarks with boxes.
BOX_SCALE = (2, 2, 0.001)


def crowded_frame() -> tuple[np.ndarray, np.ndarray]:
    """A frame of noise with 7 objects of a dozen colours each, and their boxes ``[P, 4]``."""
    places = [(20 + 45 * i, 30 + 28 * i) for i in range(OBJECTS)]
    return _colourful(HEIGHT, WIDTH, np.array([(x, y, 32, 42) for x, y in places]))


def large_frame() -> tuple[np.ndarray, np.ndarray]:
    """640 x 480 noise with five objects of 60 x 120 pixels, and their boxes ``[P, 4]``."""
    return _colourful(480, 640, np.array([(40 + 110 * i, 60 + 50 * i, 60, 120) for i in range(5)]))


def small_objects(height: int, width: int) -> tuple[np.ndarray, np.ndarray]:
    """A frame of noise with three objects of 32 x 32 pixels, and their boxes ``[P, 4]``."""
    places = [(width * (1 + i) // 4, height * (1 + i) // 4) for i in range(3)]
    return _colourful(height, width, np.array([(x, y, 32, 32) for x, y in places]))


def _colourful(height: int, width: int, boxes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(0)
    frame = rng.integers(0, 256, (height, width, 3), dtype=np.uint8)
    for x, y, w, h in boxes:
        colours = rng.integers(0, 256, (12, 3))
        frame[y : y + h, x : x + w] = colours[rng.integers(0, 12, (h, w))]
    return frame, boxes.astype(float)


def box_tracker(
    likelihood: Any, boxes: np.ndarray, ordering: Any, num_particles: int, **settings: Any
) -> jaxpf.Partitioned:
    """A tracker of boxes ``[P, 4]`` that move by ``BOX_SCALE``."""
    return jaxpf.Partitioned(
        **box_model(likelihood, boxes, BOX_SCALE)._asdict(),
        ordering=ordering,
        num_particles=num_particles,
        **settings,
    )


def line_tracker(num_particles: int, num_partitions: int = 1, **settings: Any) -> jaxpf.Partitioned:
    """``x_t = .9 x_{t-1} + n`` observed with unit noise, independently for every partition."""
    return jaxpf.Partitioned(
        **_line_model(num_partitions),
        ordering=orderings.ps(range(num_partitions)),
        num_particles=num_particles,
        **settings,
    )


def labelled_line_tracker(num_targets: int, num_particles: int) -> jaxpf.Labelled:
    """The same model with one target per partition."""
    return jaxpf.Labelled(**_line_model(num_targets), num_particles=num_particles)


def _line_model(count: int) -> dict[str, Any]:
    one = jnp.ones((count, 1, 1))
    return {
        "dynamics": LinearGaussian(transition=0.9 * one, noise=one),
        "likelihood": Gaussian(noise=one),
        "initial": jnp.zeros((count, 1)),
    }


def keep_estimate(state: Any, summary: Any) -> Any:
    """Keep the statistics that an evaluation needs."""
    return summary.estimate, summary.log_evidence, summary.ess, summary.uniqueness


def keep_report(state: Any, summary: Any) -> Any:
    """Keep the statistics that a 1-D filter reports."""
    return summary.log_evidence, summary.estimate, summary.ess


def mean_evidence(tracker: Any, keys: Any, frames: Any, checkpoint: bool | int = True) -> Any:
    """Mean log evidence over independent runs."""
    return jnp.mean(objectives.log_evidence(tracker, keys, frames, checkpoint=checkpoint))
