"""What tracking points costs: 12 points in a frame of 1080 x 1920 pixels, decoding left out."""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import jaxpf.points
from jaxpf import running
from jaxpf.cli.benchmarks.rows import Row, compared
from jaxpf.evaluation.baselines.spot import spot
from jaxpf.likelihoods.windows import windows
from jaxpf.measures.timing import interleaved

POINTS, HEIGHT, WIDTH, FRAMES = 12, 1080, 1920, 8
TITLE = f"Points: {POINTS}, {HEIGHT}x{WIDTH}, one run; decoding left out"
_WINDOWS = 480


def rows(repeats: int, height: int = HEIGHT, width: int = WIDTH) -> Iterator[Row]:
    """Nanoseconds of one window, and of a whole frame of every filter and of SPOT."""
    rng = np.random.default_rng(0)
    stack = rng.integers(0, 256, (FRAMES + 1, height, width, 3), dtype=np.uint8)
    middle = np.array([width, height]) / 2
    points = (middle + rng.uniform(-0.2, 0.2, (POINTS, 2)) * height).astype(np.float32)
    frames = jnp.asarray(stack[1:])
    key = jax.random.key(0)

    likelihood = windows(stack[0], points)
    places = np.repeat(points, _WINDOWS // POINTS, axis=0) + rng.normal(0, 10, (_WINDOWS, 2))
    partition = jnp.repeat(jnp.arange(POINTS), _WINDOWS // POINTS)
    weigh = jax.jit(likelihood.log_prob_all)
    trackers = {
        "eskil2014, M = 10, each moved once": jaxpf.points.tracker(
            stack[0], points, diffusion=10.0, upsampling=1
        ),
        "eskil2014, M = 10, each moved three times": jaxpf.points.tracker(
            stack[0], points, diffusion=10.0
        ),
        "PFFL, M = 50": jaxpf.points.tracker(stack[0], points, method="pffl", diffusion=10.0),
    }
    goals = ("3.3e6 ns or less", "3.3e6 ns or less", "6.7e6 ns or less")
    candidates: dict[str, Callable[[], Any]] = {
        "window": partial(weigh, frames[0], partition, jnp.asarray(places.T, jnp.float32))
    }
    for name, tracker in trackers.items():
        candidates[name] = partial(running.run, tracker, key, frames)
    seconds = interleaved(candidates, repeats)
    yield compared(
        "one window of 21 x 21", seconds["window"], _WINDOWS, seconds["window"], "", "<= 2800 ns"
    )
    pffl = seconds["PFFL, M = 50"]
    for name, goal in zip(trackers, goals, strict=True):
        yield compared(f"{name}: a frame", seconds[name], FRAMES, pffl, "this / PFFL", goal)
    both = interleaved(
        {"first": lambda: spot(stack[:1], points), "second": lambda: spot(stack[:2], points)}, 1
    )
    frame = np.maximum(both["second"] - both["first"], 1e-9)
    yield compared("SPOT: a frame", frame, 1, np.median(pffl)[None] / FRAMES, "this / PFFL", "")
