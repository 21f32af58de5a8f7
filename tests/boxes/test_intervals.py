"""Intervals of boxes: the size is known less well than its particles say."""

from types import SimpleNamespace

import numpy as np
import pytest

from jaxpf.boxes.adapter import ADAPTER

#: x, y, w, h.
BOX = np.array([[20.0, 30.0, 40.0, 80.0]])


@pytest.mark.parametrize("error", [0.0, 0.1])
def test_intervals_of_sizes_and_edges_hold_the_error_of_the_size(error):
    rng = np.random.default_rng(2)

    def draws(deviation):
        """Boxes [20 000, 1, 4] around one centre, of sizes that vary by a factor."""
        extent = BOX[:, 2:] * np.exp(rng.normal(0, deviation, (20_000, 1, 1)))
        return np.concatenate([BOX[:, :2] + BOX[:, 2:] / 2 - extent / 2, extent], axis=-1)

    particles = np.quantile(draws(0.05), [0.025, 0.975], axis=0)
    interval = ADAPTER.widened(BOX, particles, SimpleNamespace(size_error=error))
    truth = draws(np.hypot(0.05, error))
    held = np.mean((interval[0] <= truth) & (truth <= interval[1]), axis=0)
    # 4.5 standard errors of a share and of two 2.5 % quantiles; edges are nearly normal.
    np.testing.assert_allclose(held, 0.95, atol=4.5 * np.sqrt(2 * 0.05 * 0.95 / 20_000) + 0.005)


def test_intervals_of_likelihoods_without_such_an_error_are_the_particles():
    particles = np.stack([BOX - 1, BOX + 2])
    np.testing.assert_array_equal(ADAPTER.widened(BOX, particles, None), particles)
