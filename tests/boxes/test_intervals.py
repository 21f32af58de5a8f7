"""Intervals of boxes: the size is known less well than its particles say."""

from types import SimpleNamespace

import numpy as np
import pytest

from jaxpf.boxes.target import BOXES
from jaxpf.cli.tracking.track_table import places_of

#: x, y, w, h.
BOX = np.array([[20.0, 30.0, 40.0, 80.0]])


def draws(rng, deviation):
    """Boxes [20 000, 1, 4] around one centre, of sizes that vary by a factor."""
    extent = BOX[:, 2:] * np.exp(rng.normal(0, deviation, (20_000, 1, 1)))
    return np.concatenate([BOX[:, :2] + BOX[:, 2:] / 2 - extent / 2, extent], axis=-1)


def interval_of(particles, error):
    """The 95% interval [2, 1, 4] in tracks.csv, given the model's error of the size."""
    state = SimpleNamespace(substates=particles, log_weights=np.full(20_000, -np.log(20_000)))
    scene = SimpleNamespace(
        target=BOXES,
        first=0,
        shown_at=lambda number: number / 25,
        shapes=lambda start, substates: substates,
        model_error=lambda count: np.array([[0, 0, error]]),
    )
    places, _ = places_of(scene, 1, None, BOX, state, BOX[:, :2])
    ends = [[places[f"{name}_{level}"] for name in "xywh"] for level in ("2.5", "97.5")]
    return np.array(ends).transpose(0, 2, 1)


@pytest.mark.parametrize("error", [0.0, 0.1])
def test_intervals_of_sizes_and_edges_hold_the_error_of_the_size(error):
    rng = np.random.default_rng(2)
    interval = interval_of(draws(rng, 0.05), error)
    truth = draws(rng, np.hypot(0.05, error))
    held = np.mean((interval[0] <= truth) & (truth <= interval[1]), axis=0)
    # 4.5 standard errors of a share and of two 2.5% quantiles; edges are nearly normal.
    np.testing.assert_allclose(held, 0.95, atol=4.5 * np.sqrt(2 * 0.05 * 0.95 / 20_000) + 0.005)


def test_intervals_of_models_without_such_an_error_are_the_particles():
    particles = draws(np.random.default_rng(2), 0.05)
    expected = np.quantile(particles, [0.025, 0.975], axis=0, method="inverted_cdf")
    np.testing.assert_allclose(interval_of(particles, 0.0), expected, atol=0.02)
