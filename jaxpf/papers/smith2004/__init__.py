"""smith2004 repeated: Smith and Gatica-Perez, "Order matters: a distributed sampling method for
multi-object tracking", BMVC 2004.

Tables 1 and 2 and figure 4 on distracter scenes.
"""

from jaxpf.papers.paper import Paper
from jaxpf.papers.smith2004 import study

PAPER = Paper("smith2004", study.measure_all, study.figures)
