"""eskil2014 repeated: factored particles with dependent and constrained dynamics.

The three sequences on synthetic scenes modelled on them, with ablations and common baselines.
"""

from functools import partial

from jaxpf.papers.eskil2014 import figures, measures, methods, scenes, tables
from jaxpf.papers.judging.measures import quantities
from jaxpf.papers.paper import Paper

NOTES = (
    "The paper's films are not available.  Ours are drawn after its description (scenes fish, "
    "skydivers and face): compare figures by their order and their differences.",
    "eskil2014 is this library's default: M = 10, moved threefold; squares averaged over the "
    "window, sigma_o .1; distances relative, sigma_p .1; velocities of the last 10 frames; "
    "correlations below 0 count as 0.  'As printed' sums the squares, holds distances to .01 "
    "pixel, so that one particle of each point is left, and divides correlations by their plain "
    "sum (eq. 9).  The up-sampling and the number of frames are not published; both use ours.",
    "PFFL has M = 50 and unbiased weights; 'as printed' counts the evidence twice (eq. 5).  The "
    "paper's steps mention a drift without defining it, and lack the learned prior on relative "
    f"positions of PFFL's authors: '{methods.WITH_DRIFT}' repeats {100 * methods.MOMENTUM:g}% of "
    "a particle's last displacement, and no row has the prior.",
    "sigma_t is the published number of pixels, scaled to our film: 5 instead of 10 for the fish, "
    "because our film, 960 x 540, is half as wide and high.",
    "SIR, PS and SPS have 100 particles: as many likelihoods for every point as PFFL.",
    "SPOT is implemented from its published description, not its authors' program.",
)

PAPER = Paper(
    name="eskil2014",
    title="eskil2014 repeated: factored particles with dependent and constrained dynamics",
    scenes=50,
    measure=scenes.measure_all,
    tables=tables.tables,
    quantities=partial(quantities, "eskil2014", measures.MEASURES),
    figures=figures.figures,
    notes=NOTES,
)
