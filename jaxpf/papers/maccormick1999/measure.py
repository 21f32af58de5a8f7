"""Everything that is measured for the paper."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from jaxpf.papers.maccormick1999 import look_ahead, passing, scenes, toy
from jaxpf.papers.maccormick1999.look_ahead import Weighting
from jaxpf.papers.maccormick1999.passing import Passing
from jaxpf.papers.maccormick1999.toy import Step
from jaxpf.papers.paper import Request

#: Runs of each likelihood in figure 4, on every sequence.
RUNS_PER_SCENE = 5
#: Opaque targets are dearer, and their sequences differ more than runs: one run of each method.
_OPAQUE_RUNS = 1
WIRE_PARTICLES, WORM_PARTICLES = 300, 2000
#: Methods that are compared where there is little time.
_QUICK_LEAVES = passing.PARTITIONED, passing.AS_MANY, passing.FAILING
_QUICK_WALKERS = passing.OCCLUSION, passing.INDEPENDENT


class Found(NamedTuple):
    """What was measured.

    Attributes:
        toy: method -> the steps of figures 9 and 10.
        meetings: wires, and the filmed worms if there are any, with exclusion and without.
        ahead: look-ahead weighting of wires against the plain one.
        leaves: that pass each other, as many sequences as runs are asked for.
        walkers: likewise.
    """

    toy: Mapping[str, Sequence[Step]]
    meetings: Sequence[Passing]
    ahead: Mapping[str, Weighting]
    leaves: Passing
    walkers: Passing


def measure(request: Request) -> Found:
    """Measure all of it."""
    seeds, seed, report = request.seeds, request.seed, request.report
    report("Figure 3 and the toy of figures 9 and 10")
    steps = toy.steps(seed)
    report(f"Figure 4, wires: {len(seeds)} sequences, {RUNS_PER_SCENE} runs of each likelihood")
    wires = map(scenes.wires, seeds)
    methods = passing.likelihoods(WIRE_PARTICLES, condensation=True)
    meetings = [passing.measure(wires, seeds, methods, RUNS_PER_SCENE, report)]
    report(f"Look-ahead, wires: {len(seeds)} groups of runs")
    ahead = look_ahead.measure(meetings[0].cases, len(seeds), WIRE_PARTICLES, seed)
    if request.clips is not None:
        methods = passing.likelihoods(WORM_PARTICLES)
        for clip in request.clips:
            report(f"Figure 4, {clip.name}: {request.runs} runs of each likelihood")
            worms = [scenes.worms(clip, clip.name)]
            meetings.append(passing.measure(worms, [seed], methods, request.runs, report))

    def passed(make, seeds: range, methods) -> Passing:
        report(f"{make.__name__}: {len(seeds)} sequences, one run of each method")
        return passing.measure(map(make, seeds), seeds, methods, _OPAQUE_RUNS, report)

    # As many sequences as runs: what is claimed of opaque targets is claimed of sequences.
    many = seeds if request.quick else range(seed, seed + request.runs)
    of_leaves, of_walkers = passing.LEAVES, passing.WALKERS
    if request.quick:
        of_leaves = {name: of_leaves[name] for name in _QUICK_LEAVES}
        of_walkers = {name: of_walkers[name] for name in _QUICK_WALKERS}
    leaves = passed(scenes.leaves, many, of_leaves)
    return Found(steps, meetings, ahead, leaves, passed(scenes.walkers, many, of_walkers))
