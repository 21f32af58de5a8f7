"""eskil2014 repeated: factored particles with dependent and constrained dynamics.

The three sequences on scenes made after them, with ablations and the baselines a user would take
today; frames per second; and two animals and a fly with marked joints.
"""

from collections.abc import Callable
from pathlib import Path

from jaxpf.experiments.comparison_table import Comparison, scene_seeds
from jaxpf.experiments.eskil2014 import clips, methods, published, speed
from jaxpf.experiments.eskil2014.judgements import claims, speed_claims
from jaxpf.experiments.eskil2014.tables import figures, scene_table
from jaxpf.experiments.eskil2014.tracking import RUNS_PER_SCENE, measure

RUNS, CLIP_RUNS = 50, 50
_QUICK_SCENES = 2
_QUICK_FRAMES = 60

NOTES = (
    "The paper's films are not to be had.  Ours are drawn after its description (scenes fish, "
    "skydivers and face): figures are to be compared by their order and their differences.",
    "eskil2014 is this library's default: M = 10, moved threefold; squares averaged over the "
    "window, sigma_o .1; distances relative, sigma_p .1; velocities of the last 10 frames.  'As "
    "printed' sums the squares and holds distances to .01 pixel: one particle of each point is "
    "left.  The up-sampling and the number of frames are not published.",
    "PFFL has M = 50 and the sound weights; 'as printed' counts the evidence twice (eq. 5).",
    "SIR, PS and SPS have 100 particles: as many likelihoods for every point as PFFL.",
    "Parameters were chosen on scenes of other seeds than are used here, and on no clip.",
    "SPOT is written from its published description, not its authors' program.",
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
        InputError: ``runs`` is not a multiple of ``RUNS_PER_SCENE``; the clips are missing.
    """
    if runs is None:
        runs = _QUICK_SCENES * RUNS_PER_SCENE if quick else RUNS
    seeds = scene_seeds(runs, seed, RUNS_PER_SCENE)
    folders = clips.available(data) if data is not None else []
    # A mistake is told before the work begins.
    marked = [clips.read(folder) for folder in (folders[:1] if quick else folders)]
    names = ["platty"] if quick else list(published.SEQUENCES)
    shorter = {"num_frames": _QUICK_FRAMES} if quick else {}
    outcomes = {}
    for name in names:
        sequence = published.SEQUENCES[name]
        report(f"{name}: {len(seeds)} scenes with {RUNS_PER_SCENE} runs of every method each")
        outcomes[sequence.scene] = measure(
            sequence.scene,
            sequence.scale,
            seeds,
            methods.QUICK if quick else methods.FILTERS,
            methods.OTHERS[1:] if quick else methods.OTHERS,
            report=report,
            **shorter,
        )
    tables = [scene_table(outcome) for outcome in outcomes.values()]
    notes = list(NOTES)
    if marked:
        report("Clips")
    for clip in marked:
        found = clips.measure(clip, RUNS_PER_SCENE if quick else CLIP_RUNS, quick, report)
        tables.append(clips.table(clip, found))
    if not folders:
        notes.append(
            "The animals were left out: name the folder that holds "
            f"{', '.join(clips.CLIPS)} with --data or JAXPF_DATA."
        )
    report("Table 3: frames per second")
    timed, rates = speed.measure(names, repeats=2 if quick else 5, with_spot=not quick)
    return Comparison(
        paper="eskil2014",
        title="eskil2014 repeated: factored particles with dependent and constrained dynamics",
        tables=[*tables, timed],
        claims=[*claims(outcomes), *speed_claims(rates)],
        figures=figures(outcomes),
        notes=notes,
        settings={"runs": runs, "seed": seed, "quick": quick, "data": data is not None},
    )
