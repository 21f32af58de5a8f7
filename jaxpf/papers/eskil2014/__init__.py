"""eskil2014 repeated: Eskil, "Factored particle filtering with dependent and constrained partition
dynamics for tracking deformable objects".

The three sequences on synthetic scenes modelled on them, with ablations and common baselines.
"""

from jaxpf.papers.eskil2014 import study
from jaxpf.papers.paper import Paper

PAPER = Paper("eskil2014", study.measure_all, study.figures)
