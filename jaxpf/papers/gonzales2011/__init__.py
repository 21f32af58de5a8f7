"""gonzales2011 repeated: Gonzales, Dubuisson and Nguyen, "Simultaneous partitioned sampling for
articulated object tracking", ACIVS 2011.

Figures 8 to 11 and table 1 on the scene ``articulated``, for PS and for SPS with the paper's swap,
with the unbiased one and without, under the paper's dynamics and under dynamics that couple the
parts.
"""

from jaxpf.papers.gonzales2011 import claims, figures, flies, measure, published, tables
from jaxpf.papers.gonzales2011.scenes import NOISE, RUNS_PER_SCENE, SAMPLES
from jaxpf.papers.paper import Paper

NOTES = (
    "Some criteria were changed after sequences that are among these had been judged: "
    "jaxpf.papers.gonzales2011.claims says which, and why.",
    "The paper's sequences are not to be had.  Ours keep what the paper gives; all else is a "
    "documented parameter of the scene 'articulated'.  The paper's figures have no numbers, so "
    "only their order can be compared.",
    f"{RUNS_PER_SCENE} runs on each sequence; the sequences are the units of the intervals, which "
    "therefore hold for sequences of this kind, while the paper's 50 runs are on one sequence.",
    "Absolute dynamics are the paper's: every part walks at random.  Relative dynamics move joints "
    "and parts follow their parents; only they make the tree matter.",
    "The noise gave PS its least error on other sequences (seed 1000): "
    + "; ".join(
        f"{motion}, absolute {noise.absolute}, root {noise.root}, joint {noise.joint}"
        for motion, noise in NOISE.items()
    )
    + " (pixels, radians).",
    "The paper's swap pairs the best left arm with the best right one.  It is biased: see "
    "notebooks/swap_bias.ipynb.  'SPS combinatorial' exchanges parts without bias.  Where 'SPS "
    "sorted' alone has a lower error or variance than PS, it owes that to the bias.",
    "Variance: of the corners about their mean, to first order, summed over the parts; the paper "
    "does not define its own.  Resampling is multinomial, as in the paper's section 3.1.",
    f"Likelihoods come from {SAMPLES} x {SAMPLES} pixels of a part; the table "
    "'likelihood_error' compares them with counting every pixel.",
)

PAPER = Paper(
    name="gonzales2011",
    title="gonzales2011 repeated: simultaneous partitioned sampling",
    runs=published.RUNS,
    quick_runs=2 * RUNS_PER_SCENE,
    runs_per_scene=RUNS_PER_SCENE,
    measure=measure.measure,
    tables=tables.tables,
    claims=claims.claims,
    figures=figures.figures,
    notes=NOTES,
    read=lambda data, quick: flies.read_fly(
        data, num_frames=measure.QUICK_FRAMES if quick else flies.FRAMES
    ),
    without_clips=f"The flies were left out: they need the clip {flies.CLIP}; name the folder that "
    "holds it with --data or JAXPF_DATA.",
)
