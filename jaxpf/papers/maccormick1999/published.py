"""Settings given in maccormick1999: MacCormick and Blake, ICCV 1999.

The paper prints images and curves but no numbers.  Detection probabilities are defined with the
likelihood (``jaxpf.likelihoods``), dimensions of the shape spaces with the scenes.
"""

#: N of the leaves: with partitioned sampling, and without it.
LEAF_PARTICLES, LEAF_PARTICLES_ENOUGH = 750, 4000
#: Probability per frame that the depth order changes while targets do not overlap.
DELTA = 0.01
#: N of figure 6, and ours for each tracker of figure 1.
WALKER_PARTICLES = 2000
#: Number of frames over which figure 11 averages.
FIRST_FRAMES = 10
#: Positions of four features in figure 3, read off approximately, pixels from the line's middle.
FEATURES = (-50.0, -15.0, 20.0, 55.0)
