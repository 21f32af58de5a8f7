"""Smoothing: the posterior of every frame given the whole clip, by backward simulation.

A filter knows the frames so far.  Smoothing goes back over its weighted sets from the last frame
to the first, and draws whole trajectories from the posterior given all frames.  ``particle_gibbs``
draws them one given the other, exactly at any number of particles.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
