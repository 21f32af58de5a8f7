from .gibbs import particle_gibbs as particle_gibbs
from .groups import check_smoothing as check_smoothing
from .look_back import LookBack as LookBack
from .smoother import (
    Smoothed as Smoothed,
    SmoothedFrame as SmoothedFrame,
    smooth as smooth,
    stream as stream,
)
