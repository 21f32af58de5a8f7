from .gibbs import particle_gibbs as particle_gibbs
from .look_back import SmoothedFrame as SmoothedFrame, smooth_stream as smooth_stream
from .smoother import Smoothed as Smoothed
