"""rowe2005 repeated: Rowe, Rius, Gonzalez and Villanueva, "Towards robust multiple-target
tracking", about 2005, a particle filter with per-target weight normalisation and speed feedback.

Its synthetic test, two projectiles in front of strips that look like them: figures 2 to 4 and table
1, and its arguments that have no table.
"""

from jaxpf.papers.paper import Paper
from jaxpf.papers.rowe2005 import study

PAPER = Paper("rowe2005", study.measure_all, study.figures)
