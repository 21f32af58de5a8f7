"""Outcomes of smith2004's runs with given rates of recovery."""

import numpy as np

from jaxpf.papers.smith2004 import scenes
from jaxpf.papers.smith2004.scenes import NUM_OBJECTS, SHARPNESS, Outcome


def outcome_of(recovery, runs=scenes.RUNS_PER_SCENE, scenes_=10, seed=0):
    """An outcome in which the methods recover with given rates, all else alike."""
    names = tuple(scenes.all_orderings())
    rng = np.random.default_rng(seed)
    shape = (scenes_, len(names), len(SHARPNESS))
    rates = np.array([recovery[name if name in recovery else name.split()[0]] for name in names])
    recovered = rng.uniform(size=(*shape, runs)) < rates[:, None, None]
    share = np.clip(0.9 + 0.01 * rng.normal(size=shape), 0, 1)
    return Outcome(
        names,
        recovered=recovered,
        success=np.ones(shape),
        precision=share,
        recall=share,
        leader_precision=share,
        leader_recall=share,
        uniqueness=np.full((*shape, NUM_OBJECTS), 0.5) + 0.01 * rng.normal(size=(*shape, 7)),
        dynamics=np.ones((*shape, NUM_OBJECTS, 2)),
    )
