"""Costs of the methods, and the performance of DPS in the time of PS.

The paper compares at equal N.  We measure processor time per frame on its scene.  DPS's recovery is
known at two N and interpolated to the N at which DPS takes the time of PS.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import jaxpf
import scenes
from jaxpf.evaluation.equal_time import between, times_of
from jaxpf.measures.timing import interleaved
from jaxpf.papers.smith2004.comparison import scene_tracker
from jaxpf.papers.smith2004.conditions import Condition
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


def dps_over_ps(costs: Costs, conditions: Sequence[Condition]) -> np.ndarray | None:
    """DPS's recovery minus PS's at the largest N, where DPS takes PS's time: ``[S]``, in points.

    DPS's recovery is interpolated linearly in the logarithm of time between its two N, as in
    ``jaxpf.evaluation.equal_time``.

    Args:
        costs: at the N of the conditions.
        conditions: those that end as the library's trackers do, one for every N.

    Returns:
        None if PS's time lies outside the range of DPS's times.
    """
    ordered = sorted(conditions, key=lambda each: each.particles)
    medians = {
        method: times_of([1 / np.median(costs[each.particles][method]) for each in ordered])
        for method in ("PS", "DPS")
    }
    among = between(medians["DPS"], float(medians["PS"][-1]))
    if among is None:
        return None
    place, share = among
    fewer, more = (each.ps + each.dps_over_ps for each in ordered[place : place + 2])
    return (1 - share) * fewer + share * more - ordered[-1].ps


def _estimate(state: Any, summary: Any) -> Any:
    return summary.estimate
