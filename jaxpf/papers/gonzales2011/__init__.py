"""gonzales2011 repeated: Gonzales, Dubuisson and Nguyen, "Simultaneous partitioned sampling for
articulated object tracking", ACIVS 2011.

Figures 8 to 11 on the scene ``articulated``, for PS and for SPS with the paper's swap,
with the unbiased swap and without a swap, under the paper's dynamics and under dynamics that couple
the parts.
"""

from jaxpf.papers.gonzales2011 import study
from jaxpf.papers.paper import Paper

PAPER = Paper("gonzales2011", study.measure_all, study.figures, study.computed_quantities)
