"""Beyond the paper: look-ahead weighting against the plain one, at equal time."""

import dataclasses
import time
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from jaxpf.papers.maccormick1999.scenes import Case
from jaxpf.papers.maccormick1999.tracking import filtered, outcome_of, tracker_of
from jaxpf.papers.measuring.checkpoints import part

PLAIN, SAME_NUMBER, SAME_TIME = "plain", "look-ahead, N as plain", "look-ahead, time as plain"
#: Runs that are vectorised together, and whose variance is one unit of the intervals.
_TOGETHER = 5


class Weighting(NamedTuple):
    """G groups of runs by one way to weigh.

    Attributes:
        particles: N.
        seconds: of processor time for all groups.
        log_evidence: ``[G, runs]``, of all frames.
        kept: ``[G, runs]`` bool, both contours end on their own targets.
    """

    particles: int
    seconds: float
    log_evidence: np.ndarray
    kept: np.ndarray


def measure(
    cases: Sequence[Case], groups: int, num_particles: int, seed: int
) -> dict[str, Weighting]:
    """Track look-alikes that exclude one another, weighed plainly and with look-ahead.

    Args:
        cases: sequences of one kind; groups of runs are dealt out among them.
        groups: G.
        num_particles: of plain weighting.
        seed: of the runs.
    """
    name = f"look_ahead-{cases[0].name}-{groups}"
    plain = _run(f"{name}-plain", cases, groups, False, num_particles, seed)
    ahead = _run(f"{name}-same_number", cases, groups, True, num_particles, seed)
    as_dear = max(round(num_particles * plain.seconds / ahead.seconds), 2)
    return {
        PLAIN: plain,
        SAME_NUMBER: ahead,
        SAME_TIME: _run(f"{name}-same_time", cases, groups, True, as_dear, seed),
    }


def _run(name: str, *args: Any) -> Weighting:
    found = part(name, lambda: _measured(*args)._asdict())
    number, seconds = int(found["particles"]), float(found["seconds"])
    return Weighting(number, seconds, found["log_evidence"], found["kept"])


def _measured(
    cases: Sequence[Case], groups: int, ahead: bool, num_particles: int, seed: int
) -> Weighting:
    trackers = [
        dataclasses.replace(tracker_of(case, "wires", num_particles), look_ahead=ahead)
        for case in cases
    ]
    filtered(cases[0], trackers[0], _TOGETHER, seed)  # compiles
    seconds, outcomes = 0.0, []
    for group in range(groups):
        case, tracker = cases[group % len(cases)], trackers[group % len(cases)]
        began = time.process_time()
        found = filtered(case, tracker, _TOGETHER, seed + group)
        seconds += time.process_time() - began
        outcomes.append(outcome_of(case, tracker, found))
    return Weighting(
        num_particles,
        seconds,
        np.array([outcome.log_evidence for outcome in outcomes]),
        np.array([outcome.kept for outcome in outcomes]),
    )
