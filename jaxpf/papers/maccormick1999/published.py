"""What maccormick1999 fixes: MacCormick and Blake, ICCV 1999.

The paper prints no figures but pictures and curves.  Detection probabilities stand with the
likelihood (``jaxpf.likelihoods``), dimensions of the shape spaces with the scenes.
"""

#: N with partitioned sampling in figures 7 and 12, and unpartitioned, where tracking fails and
#: where it succeeds.
LEAF_PARTICLES, LEAF_PARTICLES_FAILING, LEAF_PARTICLES_ENOUGH = 750, 3000, 4000
#: Probability per frame that the order in depth changes where targets do not overlap.
DELTA = 0.01
#: N of figure 6, and ours of figure 1.
WALKER_PARTICLES = 2000
#: Frames over which figure 11 averages.
FIRST_FRAMES = 10
#: Places of four features on the line of figure 3, read off it roughly, pixels from its middle.
FEATURES = (-50.0, -15.0, 20.0, 55.0)
