"""maccormick1999 repeated: MacCormick and Blake, "A probabilistic exclusion principle for tracking
multiple objects", ICCV 1999.

Figures 1, 3, 4, 6, 7 and 9 to 11 on drawn scenes.
"""

from functools import partial

from jaxpf.papers.judging.measures import quantities
from jaxpf.papers.maccormick1999 import figures, measures, passing, tables
from jaxpf.papers.paper import Paper

NOTES = (
    "None of the paper's sequences is available, and it prints pictures and curves without "
    "numbers.  Scenes here are drawn (scenes.wires, scenes.leaves, scenes.walkers); what the paper "
    "fixes is kept: detection probabilities, numbers of particles, dimensions of the shape spaces.",
    "A drawn wire shows two edges, so each line of a wire counts two crossings per "
    "target, and up to four of both; the probabilities for more than two boundaries, which the "
    "paper does not give, are beta-binomial and agree with its own for two.",
    "An edge is paid for once: the paper's products over all lines (eq. 2 and 5) pay for it on the "
    "lines of every target near it, by which an outline drawn inside an opaque target is as likely "
    "as the truth.  They are available as wires-literal and opaque-literal: the rows 'as printed'.",
    "Neighbouring measurement lines see the same edges.  So that the weights do not collapse, each "
    "line across a wire or a leaf counts as .3 of an independent one.  The paper counts each in "
    "full, as ours across walkers and those of figure 11 do.",
    "Motion of wires and leaves is fitted to the truth of other sequences, and its noise enlarged; "
    "the table of chosen settings has the factors.  They were chosen with partitioned sampling, "
    "and Condensation has the same noise, which may favour the former.",
    "The paper tracks wires and walkers by ordinary Condensation; rows that say 'partitioned' are "
    "of partitioned sampling.  Figure 1 is repeated with two trackers of one walker each, of as "
    "many particles each as the filter of both has; figure 4 with one filter and P'.",
    "Some filters track only the first half or fifth of the sequences; they are compared on the "
    "sequences that both track.",
    "Resampling is systematic, where the paper draws with replacement.",
    "A label says which opaque target is in front.  It stays while shapes overlap and is redrawn "
    "while they do not; the paper flips it with probability .01 per frame, and then a small set of "
    "particles loses one order before the targets meet.  Half of the leaves are tracked so, too.",
)


PAPER = Paper(
    name="maccormick1999",
    title="maccormick1999 repeated: exclusion, occlusion and partitioned sampling",
    scenes=50,
    measure=passing.measure_all,
    tables=tables.tables,
    quantities=partial(quantities, "maccormick1999", measures.MEASURES),
    computed=lambda: {"line": [measures.of_line()]},
    figures=figures.figures,
    notes=NOTES,
)
