"""maccormick1999 repeated: MacCormick and Blake, "A probabilistic exclusion principle for tracking
multiple objects", ICCV 1999.

Figures 1, 3, 4, 6, 7 and 9 to 12 on drawn scenes, and figure 4 on a filmed crossing of two worms.
"""

from collections.abc import Callable
from pathlib import Path

from jaxpf.errors import InputError
from jaxpf.experiments.comparison_table import Comparison, scene_seeds
from jaxpf.experiments.maccormick1999 import cases, coalescence, look_ahead, one_line, opaque, toy

#: Runs of each likelihood in figure 4; of each filter in the others.
RUNS = 50
RUNS_PER_SCENE = 5
#: Opaque targets are dearer: as many sequences, and so many runs on each.
_OPAQUE_RUNS = 1
_WIRE_PARTICLES, _WORM_PARTICLES = 300, 1000

NOTES = (
    "None of the paper's sequences is to be had, and it prints no figures but pictures and curves. "
    "Scenes here are drawn (scenes.wires, scenes.leaves, scenes.walkers); what the paper fixes is "
    "kept: detection probabilities, numbers of particles, dimensions of the shape spaces.",
    "A drawn or filmed wire shows two edges, so each line of a wire counts two crossings per "
    "target, and up to four of both; the probabilities for more than two boundaries, which the "
    "paper does not give, are beta-binomial and agree with its own for two.",
    "Measurement lines lie near to one another and see the same edges: each line across a wire "
    "or a leaf counts as .3 of an independent one, each across a worm as .2, so that the "
    "particles' weights do not collapse. The paper counts each in full. A leaf keeps .95 of its "
    "speed from frame to frame, hidden or not; a walker's shape moves by a fifth of the examples' "
    "standard deviation per frame.",
    "The width of a boundary's law is 2 pixels for wires, 3 for worms, 5 for leaves and 7, the "
    "paper's, for walkers.",
    "Opaque targets carry a label that says which is in front; it is kept while shapes overlap, "
    "else flips with probability .01 per frame, and both values begin equally likely.",
    "Scenes are the units of the intervals; on the filmed clip it is the runs.",
)
_NO_CLIP = (
    "Figure 4 on filmed worms needs a real clip: name a folder that holds worm_crossing with "
    "--data or JAXPF_DATA."
)
_WORM_NOTE = (
    "worm_crossing is one filmed worm twice, composed by the darker pixel: nobody is in front, so "
    "no labels are scored.  Shapes, motion and clutter are learned from frames 0 to 40 alone, and "
    "tracking starts in frame 40 at the annotated centrelines."
)


def run(
    runs: int | None = None,
    seed: int = 0,
    quick: bool = False,
    data: Path | None = None,
    report: Callable[[str], None] = print,
) -> Comparison:
    """Repeat the paper; see ``jaxpf.experiments.comparison_table`` for the arguments.

    Raises:
        InputError: ``runs`` is not a multiple of ``RUNS_PER_SCENE``; the clip is missing.
    """
    if runs is None:
        runs = 2 * RUNS_PER_SCENE if quick else RUNS
    seeds = scene_seeds(runs, seed, RUNS_PER_SCENE)
    if data is not None and not (data / cases.CLIP).is_dir():
        raise InputError(
            f"--data {data} holds no {cases.CLIP}; name a folder that does, or leave it out."
        )
    report("Figure 3 and the toy of figures 9 and 10")
    sets = toy.particle_sets(seed)
    tables, claims = [], [*one_line.claims(), *toy.claims(sets)]
    figures = {"figure_3": one_line.figure(), "figures_9_10": toy.figure(sets)}

    report(f"Figure 4, wires: {len(seeds)} sequences, {RUNS_PER_SCENE} runs of each likelihood")
    meetings = [
        coalescence.measure(
            [cases.wires(number) for number in seeds], RUNS_PER_SCENE, _WIRE_PARTICLES, seed, report
        )
    ]
    if data is not None:
        report(f"Figure 4, {cases.CLIP}: {runs} runs of each likelihood")
        clip = cases.worms(data)
        meetings.append(coalescence.measure([clip], runs, _WORM_PARTICLES, seed, report))
    for meeting in meetings:
        tables.append(coalescence.table(meeting))
        claims += coalescence.claims(meeting)
        figures[f"figure_4_{meeting.name}"] = coalescence.figure(meeting)
        report(f"Look-ahead, {meeting.name}: {runs // RUNS_PER_SCENE} groups of runs")
        ahead = look_ahead.measure(
            meeting.cases, runs // RUNS_PER_SCENE, meeting.num_particles, seed
        )
        tables.append(look_ahead.table(meeting.name, ahead))

    leaf_methods = dict(list(opaque.LEAVES.items())[:3]) if quick else opaque.LEAVES
    for make, methods, judge, name in (
        (cases.leaves, leaf_methods, opaque.leaf_claims, "figure_7"),
        (cases.walkers, opaque.WALKERS, opaque.walker_claims, "figures_1_6"),
    ):
        report(f"{make.__name__}: {len(seeds)} sequences, {_OPAQUE_RUNS} run(s) each")
        passing = opaque.measure(make, seeds, methods, _OPAQUE_RUNS, report)
        tables.append(opaque.table(passing))
        claims += judge(passing)
        figures[name] = opaque.figure(passing, list(methods))
    return Comparison(
        paper="maccormick1999",
        title="maccormick1999 repeated: exclusion, occlusion and partitioned sampling",
        tables=tables,
        claims=claims,
        figures=figures,
        notes=(*NOTES, _NO_CLIP if data is None else _WORM_NOTE),
        settings={"runs": runs, "seed": seed, "quick": quick},
    )
