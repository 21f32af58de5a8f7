"""Costs of the methods: processor time per frame on the paper's scene."""

import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import jaxpf
import scenes
from jaxpf.measures.timing import interleaved
from jaxpf.papers.smith2004.comparison import scene_tracker
from jaxpf.papers.smith2004.scenes import METHODS, SCENE, all_orderings

#: Number of frames and of runs timed together, and number of timings.
FRAMES, RUNS, REPEATS = 6, 10, 10

#: N -> method -> seconds per frame of one run, ``[REPEATS]``.
Costs = Mapping[int, Mapping[str, np.ndarray]]


def measure(particles: Sequence[int]) -> dict[str, dict[str, np.ndarray]]:
    """Seconds as in ``Costs``, with N as text; processor time of one device."""
    scene = scenes.make("distracter", seed=0, **SCENE)
    frames = jnp.asarray(scene.frames[1 : 1 + FRAMES])
    keys = jax.random.split(jax.random.key(0), RUNS)
    orderings = all_orderings()
    names = {method: method for method in METHODS}
    names["PS"] = next(name for name in orderings if name.startswith("PS "))
    by_number = {}
    for number in particles:
        candidates: dict[str, Callable[[], Any]] = {
            method: partial(
                jaxpf.monte_carlo,
                scene_tracker(scene, orderings[name], num_particles=number),
                keys,
                frames,
                _estimate,
                RUNS,
                devices=jax.local_devices()[:1],
            )
            for method, name in names.items()
        }
        seconds = interleaved(candidates, REPEATS, time.process_time)
        by_number[str(number)] = {
            method: spent / (FRAMES * RUNS) for method, spent in seconds.items()
        }
    return by_number


def _estimate(state: Any, summary: Any) -> Any:
    return summary.estimate
