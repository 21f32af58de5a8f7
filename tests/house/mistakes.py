"""Calls that a type checker refuses, a mistake in each line that says so; ``test_types`` checks."""

import jax.numpy as jnp
import numpy as np

import jaxpf

FRAME = np.zeros((60, 80, 3), np.uint8)
BOXES = [[10, 10, 20, 20]]
PARTS = jaxpf.parts.Parts(("a",), (-1,), np.zeros((1, 3)), np.ones((1, 2)))
CONTOURS = jaxpf.contours.Contours(("a",), np.zeros((1, 6, 2)))

jaxpf.boxes.tracker(FRAME, BOXES, appearance="colour", weights="plain", num_particles=9)
jaxpf.boxes.tracker(FRAME, BOXES, appearence="colour")  # mistake
jaxpf.boxes.tracker(FRAME, BOXES, appearance="color")  # mistake
jaxpf.boxes.tracker(FRAME, BOXES, sharpness="high")  # mistake
jaxpf.boxes.tracker(FRAME, BOXES, noise_pixels=(1.0, 2.0))  # mistake
jaxpf.boxes.tracker(FRAME, BOXES, swop="none")  # mistake
jaxpf.boxes.tracker(FRAME, BOXES, drift="clipped")  # mistake
jaxpf.points.tracker(FRAME, [[1, 2]], noise_pixels=2.0)  # mistake
jaxpf.parts.tracker(FRAME, PARTS, dynamics=3)  # mistake
jaxpf.parts.tracker(FRAME, BOXES)  # mistake
jaxpf.contours.tracker(FRAME, CONTOURS, shape_space="rigid")  # mistake

MOVES, SEEN = jaxpf.dynamics.RandomWalk(1.0), jaxpf.likelihoods.Gaussian(jnp.ones((2, 1, 1)))
START, ORDER = np.zeros((2, 1)), jaxpf.ordering.sir(2)
jaxpf.Partitioned(dynamics=MOVES, likelihood=SEEN, ordering=ORDER, initial=START)
jaxpf.Partitioned(dynamics=3, likelihood=SEEN, ordering=ORDER, initial=START)  # mistake
jaxpf.Partitioned(dynamics=MOVES, likelihood=MOVES, ordering=ORDER, initial=START)  # mistake
jaxpf.Labelled(dynamics=MOVES, likelihood=SEEN, initial=START, waits="")  # mistake
jaxpf.state_space(initial=0.0, transition=max, log_likelihood=max, gradiant=3)  # mistake
