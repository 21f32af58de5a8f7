"""Everything that is measured for the paper."""

from collections.abc import Sequence
from typing import NamedTuple

from jaxpf.papers.measuring.checkpoints import part
from jaxpf.papers.paper import Request
from jaxpf.papers.smith2004 import costs, occlusions, published, sweep
from jaxpf.papers.smith2004.conditions import ENDINGS, PARTICLES, Condition, measure_conditions
from jaxpf.papers.smith2004.occlusions import Tracked
from jaxpf.papers.smith2004.scenes import RUNS_PER_SCENE, Outcome, measure as measure_scenes
from jaxpf.papers.smith2004.sweep import Sweep

#: Scenes for each distance of the sweep.
_SWEEP_SCENES, _QUICK_DISTANCES = 12, (22.0, 50.0)
_FEW, _QUICK_ENDINGS = min(PARTICLES), (next(iter(ENDINGS)), "stages counted twice")


class Found(NamedTuple):
    """What was measured.

    Attributes:
        outcome: on the paper's scene.
        swept: at several distances.
        tracked: on the real clip; empty without it.
        conditions: under which the order of objects may matter more.
        costs: of every method.
    """

    outcome: Outcome
    swept: Sweep
    tracked: Sequence[Tracked]
    conditions: Sequence[Condition]
    costs: costs.Costs


def measure(request: Request) -> Found:
    """Measure all of it."""
    seeds, report = request.seeds, request.report
    report(f"Tables 1 and 2: {len(seeds)} scenes with {RUNS_PER_SCENE} runs of every method each")
    outcome = measure_scenes(
        seeds, progress=lambda done: report(f"  scene {done} of {len(seeds)} done")
    )
    distances = _QUICK_DISTANCES if request.quick else sweep.DISTANCES
    swept_seeds = seeds[: 2 if request.quick else _SWEEP_SCENES]
    report(f"Sweep: {len(distances)} distances, {len(swept_seeds)} scene(s) each")
    swept = sweep.sweep(swept_seeds, distances, known=outcome)
    tracked: list[Tracked] = []
    if request.clips is not None:
        runs = request.runs if request.quick else max(request.runs, published.RUNS)
        report(f"{occlusions.CLIP}: {runs} runs of every method, N = {occlusions.PARTICLES}")
        tracked = occlusions.measure(request.clips, runs, request.seed)
    report("Conditions under which the order may matter more")
    particles = (_FEW,) if request.quick else PARTICLES
    endings = _QUICK_ENDINGS if request.quick else tuple(ENDINGS)
    conditions = measure_conditions(seeds, particles, endings, report)
    report("What the methods cost")
    spent = part("costs", lambda: costs.measure(particles))
    by_number = {number: spent[str(number)] for number in particles}
    return Found(outcome, swept, tracked, conditions, by_number)
