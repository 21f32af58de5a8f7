"""The figures that rowe2005 publishes, as data.

Rowe, Rius, Gonzalez and Villanueva, "Towards robust multiple-target tracking", about 2005.
"""

#: N of the synthetic test.
PARTICLES = 100

#: Figure 2 (b): range of the mean number of samples per target over runs, per cent.
SHARE_BAND = (49.5, 50.5)

#: Table 1: mean position error divided by target size, for targets 1 and 2 of each run.
TABLE_1: dict[str, tuple[tuple[float, float], ...]] = {
    "neither": ((0.1163, 0.1309), (3.8864, 0.1182), (0.1222, 0.1226), (0.1101, 2.4679)),
    "both": ((0.0715, 0.0716), (0.0849, 0.1163), (0.0987, 0.1289), (0.0645, 0.0595)),
}

#: A larger error relative to the target's size counts as a lost target: the published errors are
#: all below .14 or above 2.4.
LOST = 1.0


def tracked_mean(variant: str) -> float:
    """Mean error of the targets in table 1 that were not lost."""
    errors = [error for run in TABLE_1[variant] for error in run if error <= LOST]
    return sum(errors) / len(errors)


def losses(variant: str) -> tuple[int, int]:
    """Number of lost targets in table 1, and number of all targets."""
    errors = [error for run in TABLE_1[variant] for error in run]
    return sum(error > LOST for error in errors), len(errors)
