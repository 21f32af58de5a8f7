"""Where was it, now that the whole clip is known: backward simulation over a filter's particles.

A filter knows the frames so far.  Smoothing goes back over its weighted sets from the last frame
to the first, and draws whole trajectories from the posterior given all frames.  ``particle_gibbs``
draws them one given the other, exactly at any number of particles.
"""

from jaxpf.smoothing.gibbs import particle_gibbs
from jaxpf.smoothing.groups import check_smoothing
from jaxpf.smoothing.look_back import LookBack
from jaxpf.smoothing.smoother import Smoothed, SmoothedFrame, smooth, stream

__all__ = [
    "LookBack",
    "Smoothed",
    "SmoothedFrame",
    "check_smoothing",
    "particle_gibbs",
    "smooth",
    "stream",
]
