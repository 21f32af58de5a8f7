"""Boxes and substates for the histogram likelihood."""

import numpy as np
import pytest
from histograms import HEIGHT, NUM_BOXES, WIDTH, dyadic


@pytest.fixture(scope="session")
def boxes():
    return np.array([[10, 12, 16, 24], [40, 20, 8, 12], [60, 30, 12, 12]], float)


@pytest.fixture(scope="session")
def substates():
    """Boxes all over the frame and beyond its borders."""
    rng = np.random.default_rng(1)
    count = NUM_BOXES
    u, v = rng.uniform(-15, WIDTH + 15, count), rng.uniform(-15, HEIGHT + 15, count)
    return np.stack([dyadic(u), dyadic(v), rng.choice([0.5, 0.75, 1, 1.25, 2], count)])
