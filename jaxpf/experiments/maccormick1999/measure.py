"""Everything that is measured for the paper."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from jaxpf.experiments.maccormick1999 import look_ahead, passing, scenes, toy
from jaxpf.experiments.maccormick1999.look_ahead import Weighting
from jaxpf.experiments.maccormick1999.passing import Passing
from jaxpf.experiments.paper import Request

#: Runs of each likelihood in figure 4, on every sequence.
RUNS_PER_SCENE = 5
#: Opaque targets are dearer: as many sequences, and so many runs on each.
_OPAQUE_RUNS = 1
WIRE_PARTICLES, _WORM_PARTICLES = 300, 2000


class Found(NamedTuple):
    """What was measured.

    Attributes:
        toy: method -> substates and weights of figures 9 and 10.
        meetings: wires, and the filmed worms if there are any, with exclusion and without.
        ahead: of each meeting, look-ahead weighting against the plain one.
        leaves: that pass each other.
        walkers: that pass each other.
    """

    toy: Mapping[str, tuple[np.ndarray, np.ndarray]]
    meetings: Sequence[Passing]
    ahead: Sequence[Mapping[str, Weighting]]
    leaves: Passing
    walkers: Passing


def measure(request: Request) -> Found:
    """Measure all of it."""
    seeds, seed, report = request.seeds, request.seed, request.report
    report("Figure 3 and the toy of figures 9 and 10")
    sets = toy.particle_sets(seed)
    report(f"Figure 4, wires: {len(seeds)} sequences, {RUNS_PER_SCENE} runs of each likelihood")
    wires = map(scenes.wires, seeds)
    methods = passing.likelihoods(WIRE_PARTICLES)
    meetings = [passing.measure(wires, seeds, methods, RUNS_PER_SCENE, report)]
    if request.clips is not None:
        methods = passing.likelihoods(_WORM_PARTICLES)
        for clip in request.clips:
            report(f"Figure 4, {clip.name}: {request.runs} runs of each likelihood")
            worms = [scenes.worms(clip, clip.name)]
            meetings.append(passing.measure(worms, [seed], methods, request.runs, report))
    ahead = []
    for meeting in meetings:
        report(f"Look-ahead, {meeting.name}: {len(seeds)} groups of runs")
        particles = meeting.methods[passing.EXCLUSIVE].num_particles
        ahead.append(look_ahead.measure(meeting.cases, len(seeds), particles, seed))
    few = dict(list(passing.LEAVES.items())[:3])

    def passed(make, methods) -> Passing:
        report(f"{make.__name__}: {len(seeds)} sequences, {_OPAQUE_RUNS} run(s) each")
        return passing.measure(map(make, seeds), seeds, methods, _OPAQUE_RUNS, report)

    leaves = passed(scenes.leaves, few if request.quick else passing.LEAVES)
    return Found(sets, meetings, ahead, leaves, passed(scenes.walkers, passing.WALKERS))
