"""Tracking a case many times, and judging who ended where."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

import jaxpf
from jaxpf.experiments.maccormick1999.cases import Case, distances
from jaxpf.experiments.parts import part
from jaxpf.filters.partitioned import ordering as orderings
from jaxpf.filters.partitioned.tracker import Partitioned
from jaxpf.models.likelihoods.contours import contours
from jaxpf.models.occlusion import WithOcclusion

#: Runs that are vectorised together.
_BATCH = 5


class Outcome(NamedTuple):
    """R runs of one method on one case.

    Attributes:
        outlines: ``[R, T, 2, M, 2]``, the estimates.
        ess: ``[R, T]``.
        spread: ``[R, T, 2]``, of each target's contour, pixels, root mean square.
        kept: ``[R]`` bool, both contours end on their own targets.
        coalesced: ``[R]`` bool, both end on one.
        log_evidence: ``[R]``, of all frames.
    """

    outlines: np.ndarray
    ess: np.ndarray
    spread: np.ndarray
    kept: np.ndarray
    coalesced: np.ndarray
    log_evidence: np.ndarray


def tracker_of(case: Case, exclusion: str, num_particles: int, method: str = "ps") -> Partitioned:
    """A tracker of both targets of a case.

    Args:
        case: what is tracked.
        exclusion: see ``jaxpf.likelihoods.contours``; ``"none"`` is the paper's control.
        num_particles: N.
        method: ``"ps"``, or ``"sir"`` for the unpartitioned filter; with opaque targets, particles
            of ``"ps"`` place the target first that they believe to be in front (figure 8).
    """
    likelihood = contours(case.space, 2, exclusion=exclusion, **case.options)
    dynamics, label = case.dynamics, None
    ordering = orderings.ps([0, 1]) if method == "ps" else orderings.sir(2)
    if exclusion == "opaque":
        dynamics, label = WithOcclusion(dynamics, likelihood), np.full(2, 0.5, np.float32)
        if method == "ps":
            ordering = orderings.branched([[0, 1], [1, 0]])
    return Partitioned(
        dynamics=dynamics,
        likelihood=likelihood,
        ordering=ordering,
        initial=case.start,
        initial_label=label,
        num_particles=num_particles,
        resampling="systematic",
    )


def track(case: Case, tracker: Partitioned, runs: int, seed: int) -> Outcome:
    """Track a case in independent runs."""
    return outcome_of(case, tracker, filtered(case, tracker, runs, seed))


def filtered(case: Case, tracker: Partitioned, runs: int, seed: int) -> list[np.ndarray]:
    """What the filter reports of independent runs, for ``outcome_of``: what is to be timed."""
    keys = jax.random.split(jax.random.key(seed), runs)
    frames = jnp.asarray(case.frames)
    found = jaxpf.monte_carlo(tracker, keys, frames, _keep, batch_size=min(runs, _BATCH))
    return [np.asarray(values) for values in found]


def outcome_of(case: Case, tracker: Partitioned, found: list[np.ndarray]) -> Outcome:
    """What came of it."""
    estimates, ess, spread, log_evidence = found
    outlines = np.asarray(tracker.likelihood.outline_points(jnp.asarray(estimates)))
    kept, coalesced = judged(case, outlines)
    spread = np.sqrt((spread**2).sum(axis=-1))
    return Outcome(outlines, ess, spread, kept, coalesced, log_evidence.sum(axis=1))


def track_once(name: str, case: Case, tracker: Partitioned, runs: int, seed: int) -> Outcome:
    """As ``track``, but for what was kept under that name; see ``jaxpf.experiments.parts``."""
    return Outcome(**part(name, lambda: track(case, tracker, runs, seed)._asdict()))


def judged(case: Case, outlines: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Whether runs end with both contours on their own targets, and with both on one.

    Args:
        case: with T frames.
        outlines: ``[R, T, 2, M, 2]``.
    """
    last = distances(case, outlines)[:, -1]  # [R, estimate, target]
    on = last < case.on_target
    nearest = last.argmin(axis=-1)
    kept = on[:, 0, 0] & on[:, 1, 1] & (nearest == (0, 1)).all(axis=-1)
    coalesced = (nearest[:, 0] == nearest[:, 1]) & on[
        np.arange(len(on))[:, None], (0, 1), nearest
    ].all(axis=-1)
    return kept, coalesced


def _keep(state: Any, summary: Any) -> Any:
    return summary.estimate, summary.ess, summary.spread, summary.log_evidence
