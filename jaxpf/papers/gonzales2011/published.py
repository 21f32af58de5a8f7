"""Figures published in gonzales2011: Gonzales, Dubuisson and Nguyen, 2011.

Figures 8 to 11 are curves without numbers; the captions and the text say which curve is lower.
"""

#: Numbers of parts of the objects.
PARTS = (3, 5, 7, 9, 11)
#: Number of averaged runs in table 1.
TIMED_RUNS = 20
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

#: Table 1: numbers of particles (columns).
TABLE_1_PARTICLES = (10, 20, 40, 60, 80, 100, 200)
#: Table 1: parts -> seconds for the 300 frames of one run, for PS and for SPS.
TABLE_1 = {
    3: {
        "PS": (0.54, 0.88, 1.58, 2.99, 2.82, 3.45, 6.80),
        "SPS": (0.56, 0.91, 1.61, 2.33, 2.84, 3.50, 6.92),
    },
    5: {
        "PS": (0.71, 1.26, 2.33, 3.34, 4.43, 5.43, 11.62),
        "SPS": (0.74, 1.32, 2.42, 3.43, 4.51, 5.60, 12.05),
    },
    7: {
        "PS": (0.95, 1.72, 3.21, 4.7, 6.22, 7.86, 17.10),
        "SPS": (1.00, 1.76, 3.28, 4.84, 6.46, 7.99, 17.73),
    },
    9: {
        "PS": (1.21, 2.18, 4.12, 6.16, 8.12, 10.35, 22.06),
        "SPS": (1.25, 2.23, 4.25, 6.32, 8.40, 10.59, 22.77),
    },
    11: {
        "PS": (1.41, 2.61, 4.99, 7.38, 10.02, 12.69, 26.37),
        "SPS": (1.46, 2.77, 5.11, 7.61, 10.33, 13.01, 27.18),
    },
}
#: Probably a misprint of 2.29: at 60 particles PS would be slower than at 80, and than SPS.
SLIP = (3, "PS", 60)
