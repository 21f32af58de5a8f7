"""Smoothing: the posterior of every frame given the whole clip, by backward simulation.

A filter's estimate uses only past frames.  Smoothing goes back over the filter's weighted sets from
the last frame to the first, and draws whole trajectories from the posterior given all frames; or
it traces the particles' ancestors back, which needs no density of moves.
``particle_gibbs`` draws a sequence of trajectories, each given the previous one; it leaves the
posterior invariant at any number of particles.
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
