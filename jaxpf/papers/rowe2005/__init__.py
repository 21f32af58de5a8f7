"""rowe2005 repeated: Rowe, Rius, Gonzalez and Villanueva, a particle filter with per-target weight
normalisation and speed feedback.

Its synthetic test, two projectiles before strips that mimic them: figures 2 to 4 and table 1, and
what the paper argues without a table.
"""

from jaxpf.papers.paper import Paper
from jaxpf.papers.rowe2005 import (
    births,
    calibration,
    claims,
    figures,
    measure,
    pictures,
    published,
    tables,
)
from jaxpf.papers.rowe2005.scenes import RUNS_PER_SCENE, VARIANTS, settings_of

NOTES = (
    "The paper's scene is not to be had: it gives the numbers of frames, targets and samples, the "
    "areas and the aspects.  The rest is documented with the scene (scenes.ProjectilesParameters), "
    "so that figures are to be compared by their order and their differences, not one by one.",
    "The noises, rates and exponents of the tracker are not given.  Each variant that is compared "
    "has its own, tuned on other seeds than are used here "
    "(jaxpf.papers.rowe2005.calibration); the table of settings has them.",
    "Eq. 7 draws the size's noise by `the target's size covariance`, which the paper does not "
    "define; ours is independent for width and height, of one fixed standard deviation.",
    "Resampling is multinomial: the published band of 49.5 to 50.5 % is what that gives.",
    "Eq. 6 as printed divides weights that sum to 1/L by the number of samples; ours is the "
    "weighted mean within the target.",
    f"{RUNS_PER_SCENE} runs on each scene; the scenes are the units of the intervals, which "
    "therefore hold for scenes of this kind, while the paper's runs are on one scene.",
    "Feedback, regularising, the power and the size term are no part of an exact filter: they "
    "bias what is estimated, in exchange for what the tables show.",
    "Figure 5 is one run of ours.  The traffic sequences of figure 6 were never published; in "
    f"their place stands {pictures.CLIP}, where --data has it: one car, no reflections.",
)

PAPER = Paper(
    name="rowe2005",
    title="rowe2005 repeated: labelled particles with equal shares and speed feedback",
    runs=100,
    quick_runs=2 * RUNS_PER_SCENE,
    runs_per_scene=RUNS_PER_SCENE,
    measure=measure.measure,
    tables=tables.tables,
    claims=claims.claims,
    figures=figures.figures,
    notes=NOTES,
    read=lambda data, quick: births.read(data, births.QUICK_FRAMES if quick else None),
    without_clips="People who come and go were left out: name the folder that holds "
    f"{births.CLIP} with --data or JAXPF_DATA.",
    settings={
        "tracker": {name: settings_of(name)._asdict() for name in VARIANTS},
        "particles": published.PARTICLES,
    },
    calibrate=lambda report, data: calibration.calibrate(report),
)
