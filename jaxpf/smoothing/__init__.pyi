from .gibbs import particle_gibbs as particle_gibbs
from .smoother import (
    Smoothed as Smoothed,
    SmoothedFrame as SmoothedFrame,
    smooth_stream as smooth_stream,
)
