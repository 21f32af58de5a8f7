"""Real clips: what the project promises of them.  Skipped where there are none."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxpf
from jaxpf import measures
from jaxpf.likelihoods import histogram
from jaxpf.sequences import open_sequence
from jaxpf.shapes import boxes_from_substates

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def campus(data_folder):
    """The clip with objects 1 to 5, its likelihood learned in frame 0."""
    scene = open_sequence(data_folder / "tud_campus").scene([1, 2, 3, 4, 5], start_frame=0)
    likelihood = histogram(scene.frames[0], scene.boxes[0], sharpness=20.0, method="integral")
    return scene, likelihood


# The last frame in which another walker is hidden by object 3 (events.csv of the clip).
LAST_OCCLUSION = 54


def kept_through_the_occlusions(campus, method):
    """In how many of 20 seeds object 3's box meets the truth in every frame until then."""
    scene, likelihood = campus
    tracker = jaxpf.boxes.tracker(
        None, scene.boxes[0], likelihood=likelihood, method=method, noise_pixels=(4, 2, 0.003)
    )
    keys = jnp.stack([jax.random.key(seed) for seed in range(20)])
    summary = jaxpf.monte_carlo(tracker, keys, jnp.asarray(scene.frames[1:]), batch_size=20)
    boxes = boxes_from_substates(summary.estimate, scene.boxes[0][:, 2:])[:, :LAST_OCCLUSION]
    truth = scene.boxes[1 : LAST_OCCLUSION + 1]
    return int(np.sum(measures.success(boxes, truth)[:, 2]))


def test_dps_keeps_the_occluded_walker_and_sir_does_not(campus):
    dps = kept_through_the_occlusions(campus, "dps")
    sir = kept_through_the_occlusions(campus, "sir")
    print(f"object 3 kept through the occlusions, 20 seeds: DPS {dps}, SIR {sir}")
    assert dps >= 18
    assert sir < 18
