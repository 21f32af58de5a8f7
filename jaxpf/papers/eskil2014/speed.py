"""Frames per second of two of the three systems that the paper compares (table 3)."""

import time
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np

import scenes
from jaxpf import running
from jaxpf.measures.timing import interleaved
from jaxpf.papers.eskil2014 import methods, published

#: Number of frames for timing.
FRAMES = 40

Rates = dict[str, dict[str, np.ndarray]]


def measure(names: Sequence[str], repeats: int) -> Rates:
    """Sequence -> method -> frames per second ``[repeats]``, in processor time.

    One run at a time, without decoding.

    Args:
        names: names of the paper's sequences.
        repeats: timings per method, interleaved.
    """
    rates = {}
    key = jax.random.key(0)
    for name in names:
        sequence = published.SEQUENCES[name]
        scene = scenes.make(sequence.scene, seed=0, num_frames=FRAMES + 1)
        points, frames = scene.extras["points"][0], jnp.asarray(scene.frames[1:])
        trackers = methods.trackers(
            scene.frames[0], points, sequence.scale_here, (methods.PROPOSED, methods.PFFL)
        )
        candidates = {
            method: lambda tracker=tracker, frames=frames: running.run(tracker, key, frames)
            for method, tracker in trackers.items()
        }
        seconds = interleaved(candidates, repeats, time.process_time)
        rates[name] = {method: FRAMES / spent for method, spent in seconds.items()}
    return rates
