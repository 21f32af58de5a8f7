"""maccormick1999 repeated: MacCormick and Blake, "A probabilistic exclusion principle for tracking
multiple objects", ICCV 1999.

Figures 1, 3, 4, 6, 7 and 9 to 12 on drawn scenes, and figure 4 on a filmed crossing of two worms.
"""

from pathlib import Path

from jaxpf.papers.maccormick1999 import claims, figures, measure, scenes, tables
from jaxpf.papers.paper import Paper, clip_folder

NOTES = (
    "None of the paper's sequences is available, and it prints pictures and curves without "
    "numbers.  Scenes here are drawn (scenes.wires, scenes.leaves, scenes.walkers); what the paper "
    "fixes is kept: detection probabilities, numbers of particles, dimensions of the shape spaces.",
    "A drawn or filmed wire shows two edges, so each line of a wire counts two crossings per "
    "target, and up to four of both; the probabilities for more than two boundaries, which the "
    "paper does not give, are beta-binomial and agree with its own for two.",
    "An edge is paid for once: the paper's products over all lines (eq. 2 and 5) pay for it on the "
    "lines of every target near it, by which an outline drawn inside an opaque target is as likely "
    "as the truth.  They are available as wires-literal and opaque-literal: the rows 'as printed'.",
    "Neighbouring measurement lines see the same edges.  So that the weights do not collapse, each "
    "line across a wire or a leaf counts as .3 of an independent one, each across a worm as .2.  "
    "The paper counts each in full, as ours across walkers and those of figure 11 do.",
    "Motion of wires and leaves is fitted to the truth of other sequences, and its noise enlarged; "
    "the table of chosen settings has the factors.  They were chosen with partitioned sampling, "
    "and Condensation has the same noise, which may favour the former.",
    "A worm bends and keeps its length (jaxpf.shapes.bending_space): in a space of principal "
    "components its contour shrank to a third of the worm in contact.",
    "The paper tracks wires and walkers by ordinary Condensation; rows that say 'partitioned' are "
    "of partitioned sampling.  Without exclusion one filter tracks both targets with P', instead "
    "of two trackers as in figure 1.",
    "Some filters track only the first half or fifth of the sequences; they are compared on the "
    "sequences that both track.",
    "Resampling is systematic, where the paper draws with replacement.",
    "The width of a boundary's law is 2 pixels for wires, 3 for worms, 5 for leaves and 7, the "
    "paper's, for walkers.",
    "A label says which opaque target is in front.  It stays while shapes overlap and is redrawn "
    "while they do not; the paper flips it with probability .01 per frame, and then a small set of "
    "particles loses one order before the targets meet.  Half of the leaves are tracked so, too.",
    "Intervals are over scenes, and for the filmed clips over runs.",
)


def _clips(data: Path) -> list[Path]:
    """Folders of the filmed worms; the longer contact is optional."""
    first = clip_folder(data, scenes.CLIP, needed="centrelines.csv")
    other = first.parent / scenes.OTHER_CLIP
    return [first, other] if (other / "centrelines.csv").is_file() else [first]


PAPER = Paper(
    name="maccormick1999",
    title="maccormick1999 repeated: exclusion, occlusion and partitioned sampling",
    scenes=50,
    measure=measure.measure,
    tables=tables.tables,
    quantities=claims.quantities,
    figures=figures.figures,
    notes=NOTES,
    read=lambda data, quick: _clips(data),
    without_clips="Figure 4 on filmed worms needs a real clip: name a folder that holds "
    "worm_crossing with --data or JAXPF_DATA.",
    with_clips="worm_crossing, on which the settings were chosen, and worm_crossing_long, on which "
    "nothing was, are each one filmed worm twice, composed by the darker pixel: neither is in "
    "front, so no labels are scored.  Shapes, motion and clutter are learned from frames 0 to 40 "
    "alone, and tracking starts in frame 40 at the annotated centrelines.",
)
