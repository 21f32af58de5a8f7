"""Benchmark problems: boxes on noise, and a 1-D model."""

from typing import Any

import jax.numpy as jnp
import numpy as np

import jaxpf
from jaxpf import ordering as orderings
from jaxpf.boxes.models import box_model
from jaxpf.dynamics.gaussian import LinearGaussian
from jaxpf.likelihoods.gaussian import Gaussian

#: Noise of x, y (pixels) and of the scale.
BOX_SCALE = (2, 2, 0.001)


def frame_with_boxes(
    count: int, height: int = 288, width: int = 360, size: tuple[int, int] = (32, 42)
) -> tuple[np.ndarray, np.ndarray]:
    """A frame of noise with objects of a dozen colours each on its diagonal; their boxes."""
    rng = np.random.default_rng(0)
    frame = rng.integers(0, 256, (height, width, 3), dtype=np.uint8)
    w, h = size
    step = np.array([width - w - 20, height - h - 30]) // count
    boxes = np.array([(20 + i * step[0], 30 + i * step[1], w, h) for i in range(count)])
    for x, y, _, _ in boxes:
        colours = rng.integers(0, 256, (12, 3))
        frame[y : y + h, x : x + w] = colours[rng.integers(0, 12, (h, w))]
    return frame, boxes.astype(float)


def box_tracker(
    likelihood: Any, boxes: np.ndarray, ordering: Any, num_particles: int
) -> jaxpf.Partitioned:
    """A tracker of boxes ``[P, 4]`` that move by ``BOX_SCALE``."""
    return jaxpf.Partitioned(
        **box_model(likelihood, boxes, BOX_SCALE)._asdict(),
        ordering=ordering,
        num_particles=num_particles,
    )


def line_tracker(num_particles: int) -> jaxpf.Partitioned:
    """``x_t = .9 x_{t-1} + n``, observed with unit noise."""
    unit = jnp.ones((1, 1, 1))
    return jaxpf.Partitioned(
        dynamics=LinearGaussian(transition=0.9 * unit, noise=unit),
        likelihood=Gaussian(noise=unit),
        initial=jnp.zeros((1, 1)),
        ordering=orderings.sir(1),
        num_particles=num_particles,
    )
