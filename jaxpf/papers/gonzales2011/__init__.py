"""gonzales2011 repeated: Gonzales, Dubuisson and Nguyen, "Simultaneous partitioned sampling for
articulated object tracking", ACIVS 2011.

Figures 8 to 11 on the scene ``articulated``, for PS and for SPS with the paper's swap,
with the unbiased swap and without a swap, under the paper's dynamics and under dynamics that couple
the parts.
"""

from functools import partial

from jaxpf.papers.gonzales2011 import figures, measures, tables
from jaxpf.papers.gonzales2011.scenes import measure_all
from jaxpf.papers.judging.measures import quantities
from jaxpf.papers.paper import Paper

NOTES = (
    "The paper's sequences are not available.  Ours keep what the paper gives; the rest are "
    "documented parameters of the scene 'articulated'.  The paper's figures have no numbers, so "
    "only their order can be compared.",
    "One run on each sequence: the intervals are about sequences of this kind, while the paper's "
    "50 runs are on one sequence.",
    "Errors and variances are compared by the geometric mean of the sequences' ratios.",
    "Absolute dynamics are the paper's: every part walks at random.  Relative dynamics move joints "
    "and parts follow their parents; only they make the tree matter.",
    "The paper's swap pairs the best left arm with the best right one.  It is biased: see "
    "notebooks/swap_bias.ipynb.  'SPS combinatorial' exchanges parts without bias.  Where 'SPS "
    "sorted' alone has a lower error or variance than PS, it owes that to the bias.",
    "Variance: of the corners about their mean, to first order, summed over the parts; the paper "
    "does not define its own.  Resampling is multinomial, as in the paper's section 3.1.",
)

PAPER = Paper(
    name="gonzales2011",
    title="gonzales2011 repeated: simultaneous partitioned sampling",
    scenes=50,
    measure=measure_all,
    tables=tables.tables,
    quantities=partial(quantities, "gonzales2011", measures.MEASURES),
    computed=measures.computed_quantities,
    figures=figures.figures,
    notes=NOTES,
)
