"""maccormick1999 repeated: MacCormick and Blake, "A probabilistic exclusion principle for tracking
multiple objects", ICCV 1999.

Figures 1, 3, 4, 6, 7 and 9 to 12 on drawn scenes, and figure 4 on a filmed crossing of two worms.
"""

from pathlib import Path

from jaxpf.papers.maccormick1999 import calibration, claims, figures, measure, scenes, tables
from jaxpf.papers.maccormick1999.measure import RUNS_PER_SCENE
from jaxpf.papers.paper import Paper, clip_folder

NOTES = (
    "None of the paper's sequences is to be had, and it prints no figures but pictures and curves. "
    "Scenes here are drawn (scenes.wires, scenes.leaves, scenes.walkers); what the paper fixes is "
    "kept: detection probabilities, numbers of particles, dimensions of the shape spaces.",
    "A drawn or filmed wire shows two edges, so each line of a wire counts two crossings per "
    "target, and up to four of both; the probabilities for more than two boundaries, which the "
    "paper does not give, are beta-binomial and agree with its own for two.",
    "An edge is paid for once: the paper's products over all lines (eq. 2 and 5) pay for it on the "
    "lines of every target near it, by which an outline drawn inside an opaque target is as likely "
    "as the truth. They are there as wires-literal and opaque-literal.",
    "Measurement lines lie near to one another and see the same edges: each line across a wire "
    "or a leaf counts as .3 of an independent one, each across a worm as .2, so that the "
    "particles' weights do not collapse. The paper counts each in full, as ours across walkers do. "
    "A walker's shape moves by "
    "a fifth of the examples' standard deviation per frame.",
    "Motion of wires and leaves is fitted to the truth of other sequences.  For wires its noise is "
    "taken four times with exclusion and three times without, each as it keeps most wires on seeds "
    "that are not reported (jaxpf.papers.maccormick1999.calibration); for leaves three times, "
    "likewise.  Partitioned sampling was searched with, and Condensation has the same noise, which "
    "may favour the former.  A walker shifts by one and a half times the mean step of others.",
    "A worm bends and keeps its length (jaxpf.shapes.bending_space): in a space of principal "
    "components its contour shrank to a third of the worm in contact, and of 50 runs on "
    "worm_crossing_long none kept both. It keeps .9 of its motion; noise is three times that of "
    "the smoothed marks with exclusion and four times without, chosen on worm_crossing.",
    "Verdicts on wires, worms and walkers are on partitioned sampling, where the paper's section 3 "
    "has ordinary Condensation, which has rows and claims of its own on wires and walkers, with as "
    "many particles. Without exclusion both targets are in one filter with P', not in two trackers "
    "as in figure 1.",
    "Leaves and walkers are as many sequences as runs are asked for; one in five or ten of them is "
    "tracked by dear filters, those of few particles and those that lose nearly every target. "
    "Comparisons are made on sequences that both have.",
    "Figure 11 averages after 10 frames, before our leaves overlap.  A line that counts .3 makes "
    "weights more alike than the paper's, by which SIR gains more than partitioned sampling: the "
    "ratio of their effective sample sizes is that of such lines.",
    "Resampling is systematic, where the paper draws with replacement.",
    "The width of a boundary's law is 2 pixels for wires, 3 for worms, 5 for leaves and 7, the "
    "paper's, for walkers.",
    "Opaque targets carry a label that says which is in front; it is kept while shapes overlap, "
    "and drawn anew while they do not, where the paper flips it with probability .01 per frame: "
    "then few particles forget one order before the targets meet. One in five sequences of leaves "
    "is tracked so, too.",
    "Scenes are the units of the intervals; on the filmed clip it is the runs.",
)


def _clips(data: Path) -> list[Path]:
    """Folders of the filmed worms; the longer contact is read where it is there."""
    first = clip_folder(data, scenes.CLIP, needed="centrelines.csv")
    other = first.parent / scenes.OTHER_CLIP
    return [first, other] if (other / "centrelines.csv").is_file() else [first]


PAPER = Paper(
    name="maccormick1999",
    title="maccormick1999 repeated: exclusion, occlusion and partitioned sampling",
    runs=50,
    quick_runs=2 * RUNS_PER_SCENE,
    runs_per_scene=RUNS_PER_SCENE,
    measure=measure.measure,
    tables=tables.tables,
    claims=claims.claims,
    figures=figures.figures,
    notes=NOTES,
    read=lambda data, quick: _clips(data),
    without_clips="Figure 4 on filmed worms needs a real clip: name a folder that holds "
    "worm_crossing with --data or JAXPF_DATA.",
    with_clips="worm_crossing, on which the settings were chosen, and worm_crossing_long, on which "
    "nothing was, are each one filmed worm twice, composed by the darker pixel: nobody is in "
    "front, so no labels are scored.  Shapes, motion and clutter are learned from frames 0 to 40 "
    "alone, and tracking starts in frame 40 at the annotated centrelines.",
    calibrate=calibration.calibrate,
)
