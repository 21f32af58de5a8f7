"""Track a case many times, and judge where the contours end."""

import dataclasses
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

import jaxpf
from jaxpf import ordering as orderings
from jaxpf.contract.state import Summary
from jaxpf.dynamics.occlusion import WithOcclusion
from jaxpf.filters.partitioned.tracker import Partitioned
from jaxpf.likelihoods.contours import contours
from jaxpf.lowering import platform
from jaxpf.papers.maccormick1999.scenes import Case, distances

#: Number of runs vectorised together.
_BATCH = 5
#: Probability per frame that the depth order of non-overlapping targets is redrawn; see
#: ``settings.csv``.  While the targets are apart nothing reveals the order, and at the paper's .01
#: a filter with few particles loses one of the two orders before they meet.
REDRAWN = 0.5


class Outcome(NamedTuple):
    """R runs of one method on one case.

    Attributes:
        outlines: ``[R, T, 2, M, 2]``, the estimates.
        ess: ``[R, T]``.
        spread: ``[R, T, 2]``, of each target's contour, pixels, root mean square.
        kept: ``[R]`` bool, both contours end on their own targets.
        coalesced: ``[R]`` bool, both end on one target.
        swapped: ``[R]`` bool, each ends on the other's target.
        in_front: ``[R, T]``, probability that the first target is in front; NaN without labels.
    """

    outlines: np.ndarray
    ess: np.ndarray
    spread: np.ndarray
    kept: np.ndarray
    coalesced: np.ndarray
    swapped: np.ndarray
    in_front: np.ndarray


def tracker_of(
    case: Case,
    exclusion: str,
    num_particles: int,
    method: str = "ps",
    flip: float = REDRAWN,
    resampling: str = "systematic",
) -> Partitioned:
    """Build a tracker of both targets of a case.

    Args:
        case: the case.
        exclusion: see ``jaxpf.likelihoods.contours``; ``"none"`` is the paper's control.
        num_particles: N.
        method: ``"ps"``; ``"sir"`` for the unpartitioned filter, ordinary Condensation;
            ``"independent"`` for one Condensation tracker of N particles for each target.  With
            opaque targets, particles of ``"ps"`` place the target first that their label puts in
            front (figure 8).
        flip: for opaque targets, probability per frame that their depth order changes while they do
            not overlap.
        resampling: see ``jaxpf.Partitioned``.
    """
    likelihood = contours(case.space, 2, exclusion=exclusion, **case.options)
    dynamics, label = case.dynamics, None
    if (rule := exclusion.removesuffix("-literal")) in case.noise:
        noise = case.noise[rule] * np.asarray(dynamics.noise)
        dynamics = dataclasses.replace(dynamics, noise=noise)
    ordering = {
        "ps": orderings.ps([0, 1]),
        "sir": orderings.sir(2),
        # All pairings of the two targets' particles: each target is resampled by its own weights.
        "independent": orderings.sps(num_partitions=2),
    }[method]
    if rule == "opaque":
        dynamics, label = WithOcclusion(dynamics, likelihood, flip), np.full(2, 0.5, np.float32)
        if method == "ps":
            ordering = orderings.branched([[0, 1], [1, 0]])
    return Partitioned(
        dynamics=dynamics,
        likelihood=likelihood,
        ordering=ordering,
        initial=case.start,
        initial_label=label,
        num_particles=num_particles,
        resampling=resampling,
    )


def track(case: Case, tracker: Partitioned, runs: int, seed: int) -> Outcome:
    """Track a case in independent runs."""
    keys = jax.random.split(jax.random.key(seed), runs)
    frames = jnp.asarray(case.frames)
    width = None if platform.on_accelerator() else min(runs, _BATCH)
    recorded = jaxpf.monte_carlo(tracker, keys, frames, _keep, batch_size=width)
    estimates, ess, spread, in_front = (np.asarray(each) for each in recorded)
    outlines = np.asarray(tracker.likelihood.outline_points(jnp.asarray(estimates)))
    spread = np.sqrt((spread**2).sum(axis=-1))
    ends = judged(case, outlines)
    return Outcome(outlines, ess, spread, *ends, in_front)


def judged(case: Case, outlines: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Whether runs end with both contours on their own targets, on one, or on each other's.

    All three are False for a run in which a contour ends on no target.

    Args:
        case: with T frames.
        outlines: ``[R, T, 2, M, 2]``.
    """
    last = distances(case, outlines)[:, -1]  # [R, estimate, target]
    on = (last.min(axis=-1) < case.on_target).all(axis=-1)
    first, second = last.argmin(axis=-1).T
    return on & (first < second), on & (first == second), on & (first > second)


def _keep(state: object, summary: Summary) -> tuple[jax.Array, ...]:
    labels = summary.label_probabilities
    in_front = jnp.nan * summary.ess if labels is None else labels[0]
    return summary.estimate, summary.ess, summary.spread, in_front
