"""Trackers built from a frame step under ``jax_enable_x64``, and keep their substates' type."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxpf
import scenes
from jaxpf.contours import Contours
from jaxpf.shapes.splines import fit_spline

STREET = scenes.make("walkers", seed=1, num_frames=3)
WIRES = scenes.make("wires", seed=1, num_frames=3)
PUPPET = scenes.make("articulated", seed=1, num_frames=3)


def boxes(method):
    start = STREET.boxes[0, :2]
    return STREET, jaxpf.boxes.tracker(STREET.frames[0], start, method=method, num_particles=20)


def points(method):
    places = [[100, 100], [150, 120]]
    return STREET, jaxpf.points.tracker(STREET.frames[0], places, method=method, num_particles=20)


def parts():
    extras, names = PUPPET.extras, tuple(range(len(PUPPET.sizes)))
    given = jaxpf.parts.Parts(names, extras["parents"], extras["poses"][0], PUPPET.sizes)
    return PUPPET, jaxpf.parts.tracker(PUPPET.frames[0], given, num_particles=20)


def contours():
    points = np.array([fit_spline(line, 8, closed=False) for line in WIRES.extras["outlines"][0]])
    start = Contours(("left", "right"), points, closed=False, width=4.0)
    return WIRES, jaxpf.contours.tracker(WIRES.frames[0], start, num_particles=20)


MADE = {
    **{method: partial(boxes, method) for method in ("dps", "pffl", "labelled")},
    **{f"points, {method}": partial(points, method) for method in ("pffl", "eskil")},
    "parts": parts,
    "contours": contours,
}


@pytest.mark.parametrize(
    "made",
    ["points, pffl", *(pytest.param(n, marks=pytest.mark.slow) for n in ("dps", "points, eskil"))],
)
def test_a_tracker_is_traced_under_64_bits(made):
    with jax.enable_x64(True):
        scene, tracker = MADE[made]()
        key, frames = jax.random.key(0), jnp.asarray(scene.frames[1:])
        state, summary = jax.eval_shape(lambda key: jaxpf.run(tracker, key, frames), key)
        start = jax.eval_shape(tracker.init, key)
    assert state.log_weights.dtype == summary.estimate.dtype == start.log_weights.dtype


@pytest.mark.slow
@pytest.mark.parametrize("made", MADE)
def test_a_tracker_steps_under_64_bits(made):
    with jax.enable_x64(True):
        scene, tracker = MADE[made]()
        state, summary = jaxpf.run(tracker, jax.random.key(0), jnp.asarray(scene.frames[1:]))
        start = tracker.init(jax.random.key(0)).log_weights
        assert state.log_weights.dtype == summary.estimate.dtype == start.dtype
    assert np.isfinite(summary.estimate).all()
    assert np.isfinite(summary.confidence).all()
