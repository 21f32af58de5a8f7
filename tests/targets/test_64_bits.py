"""Trackers built from a frame step under ``jax_enable_x64``, and keep their substates' type."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxpf
import scenes
from jaxpf.contours import Contours
from jaxpf.shapes import fit_spline

STREET = scenes.make("walkers", seed=1, num_frames=3)
WIRES = scenes.make("wires", seed=1, num_frames=3)
PUPPET = scenes.make("articulated", seed=1, num_frames=3)


def boxes(**options):
    return STREET, jaxpf.boxes.tracker(STREET.frames[0], STREET.boxes[0, :2], **options)


def points(**options):
    places = [[100, 100], [150, 120]]
    return STREET, jaxpf.points.tracker(STREET.frames[0], places, **options)


def parts():
    extras = PUPPET.extras
    given = jaxpf.parts.Parts(
        tuple(range(len(PUPPET.sizes))), extras["parents"], extras["poses"][0], PUPPET.sizes
    )
    return PUPPET, jaxpf.parts.tracker(PUPPET.frames[0], given, particles=20)


def contours():
    points = np.array([fit_spline(line, 8, closed=False) for line in WIRES.extras["outlines"][0]])
    start = Contours(("left", "right"), points, closed=False, width=4.0)
    return WIRES, jaxpf.contours.tracker(WIRES.frames[0], start, particles=20)


@pytest.mark.parametrize(
    "made",
    [
        pytest.param(lambda: boxes(particles=20), id="boxes"),
        pytest.param(lambda: points(particles=20), id="points"),
        pytest.param(lambda: points(particles=20, method="eskil"), id="eskil"),
        pytest.param(contours, id="contours", marks=pytest.mark.slow),
        pytest.param(parts, id="parts", marks=pytest.mark.slow),
        pytest.param(
            lambda: boxes(particles=20, method="labelled"), id="labelled", marks=pytest.mark.slow
        ),
        pytest.param(lambda: boxes(particles=20, method="pffl"), id="pffl", marks=pytest.mark.slow),
    ],
)
def test_a_tracker_steps_under_64_bits(made):
    with jax.enable_x64(True):
        scene, tracker = made()
        state, summary = jaxpf.run(tracker, jax.random.key(0), jnp.asarray(scene.frames[1:]))
        start = tracker.init(jax.random.key(0)).log_weights
        assert state.log_weights.dtype == summary.estimate.dtype == start.dtype
    assert np.isfinite(summary.estimate).all()
    assert np.isfinite(summary.confidence).all()
