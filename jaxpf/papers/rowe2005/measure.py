"""All measurements for the paper."""

from typing import NamedTuple

from jaxpf.papers.paper import Request
from jaxpf.papers.rowe2005.scenes import (
    RUNS_PER_SCENE,
    VARIANTS,
    Outcome,
    measure as measure_scenes,
)


class Measurement(NamedTuple):
    """All measurements.

    Attributes:
        outcome: runs of all variants.
        crossing: runs of the mean and of the product on targets that cross.
    """

    outcome: Outcome
    crossing: Outcome


def measure(request: Request) -> Measurement:
    """Run all measurements."""
    seeds, report = request.seeds, request.report
    report(f"{len(seeds)} scenes with {RUNS_PER_SCENE} runs of every variant each")
    outcome = measure_scenes(
        seeds, progress=lambda done: report(f"  scene {done} of {len(seeds)} done")
    )
    report("Targets that cross: mean against product")
    likelihoods = {name: VARIANTS[name] for name in ("both", "product")}
    crossing = measure_scenes(seeds, likelihoods, name="crossing", paths="crossing")
    return Measurement(outcome, crossing)
