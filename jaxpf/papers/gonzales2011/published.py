"""Figures published in gonzales2011: Gonzales, Dubuisson and Nguyen, 2011.

Figures 8 to 11 are curves without numbers; the captions and the text say which curve is lower.
"""

#: Numbers of parts of the objects.
PARTS = (3, 5, 7, 9, 11)
FRAMES = 300
#: Lambda of the likelihood exp(-lambda d^2).
SHARPNESS = 50.0

#: Figure 8: numbers of particles, and numbers of parts of the objects.
FIGURE_8_PARTICLES, FIGURE_8_PARTS = (2, 5, 10, 20, 30, 40), (7, 9)
#: Figure 9: variance of the particle set, for the numbers of parts in figure 8.
FIGURE_9_PARTICLES = 10
#: Figure 10: strong motion at the beginning, for all numbers of parts.
FIGURE_10_PARTICLES = 20
#: Figure 11: strong and erratic motion throughout.
FIGURE_11_PARTICLES, FIGURE_11_PARTS = 10, 5
