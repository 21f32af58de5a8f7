"""Frames per second of the three systems that the paper compares (table 3)."""

import time
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np

import scenes
from jaxpf import running
from jaxpf.measures.timing import interleaved, seconds_of
from jaxpf.papers.eskil2014 import methods, published
from jaxpf.papers.eskil2014.spot import spot

#: Number of frames for timing filters, and for timing SPOT.
FRAMES, SPOT_FRAMES = 40, 4

Rates = dict[str, dict[str, np.ndarray]]


def measure(names: Sequence[str], repeats: int, with_spot: bool = True) -> Rates:
    """Sequence -> method -> frames per second ``[repeats]``, in processor time.

    One run at a time, without decoding.

    Args:
        names: names of the paper's sequences.
        repeats: timings per method, interleaved.
        with_spot: also time SPOT.
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
        if with_spot:
            rates[name][methods.SPOT] = _spot_rates(
                scene.frames[: SPOT_FRAMES + 1], points, repeats
            )
    return rates


def _spot_rates(frames: np.ndarray, points: np.ndarray, repeats: int) -> np.ndarray:
    spot(frames[:1], points)  # fills OpenCV's caches
    # Processor time: on a busy machine, differences of wall-clock times are meaningless.
    spent = [
        seconds_of(lambda: spot(frames, points)) - seconds_of(lambda: spot(frames[:1], points))
        for _ in range(repeats)
    ]
    return (len(frames) - 1) / np.array(spent)
