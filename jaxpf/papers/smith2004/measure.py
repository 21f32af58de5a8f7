"""All measurements for the paper."""

from collections.abc import Sequence
from typing import NamedTuple

from jaxpf.papers.paper import Request
from jaxpf.papers.smith2004.conditions import ENDINGS, PARTICLES, Condition, measure_conditions
from jaxpf.papers.smith2004.scenes import Outcome, measure as measure_scenes

_FEW, _QUICK_ENDINGS = min(PARTICLES), (next(iter(ENDINGS)), "stages counted twice")


class Measurement(NamedTuple):
    """All measurements.

    Attributes:
        outcome: runs on the paper's scene.
        conditions: conditions under which the order of objects may matter more.
    """

    outcome: Outcome
    conditions: Sequence[Condition]


def measure(request: Request) -> Measurement:
    """Run all measurements."""
    seeds, quick, report = request.seeds, request.quick, request.report
    report(f"Tables 1 and 2: {len(seeds)} scenes")
    outcome = measure_scenes(
        seeds, progress=lambda done: report(f"  scene {done} of {len(seeds)} done")
    )
    report("Conditions under which the order may matter more")
    particles = (_FEW,) if quick else PARTICLES
    endings = _QUICK_ENDINGS if quick else tuple(ENDINGS)
    conditions = measure_conditions(seeds, particles, endings, report)
    return Measurement(outcome, conditions)
