"""maccormick1999 repeated: MacCormick and Blake, "A probabilistic exclusion principle for tracking
multiple objects", ICCV 1999.

Figures 1, 3, 4, 6, 7 and 9 to 11 on drawn scenes.
"""

from jaxpf.papers.judging.estimates import computed
from jaxpf.papers.maccormick1999 import study, toy
from jaxpf.papers.paper import Paper

PAPER = Paper(
    "maccormick1999",
    study.measure_all,
    study.figures,
    computed=lambda: {"line": [computed(toy.ratio_of_peaks())]},
)
