"""Intervals of boxes: the size is known less well than its particles say."""

import dataclasses

import numpy as np
import pytest
from columns_of_tracks import columns_of

from jaxpf.boxes.target import BOXES

#: x, y, w, h.
BOX = np.array([[20.0, 30.0, 40.0, 80.0]])


def draws(rng, place, size):
    """Boxes [20 000, 1, 4] around one: the centre moves by pixels, the size by a factor."""
    centre = BOX[:, :2] + BOX[:, 2:] / 2 + rng.normal(0, place, (20_000, 1, 2))
    extent = BOX[:, 2:] * np.exp(rng.normal(0, size, (20_000, 1, 1)))
    return np.concatenate([centre - extent / 2, extent], axis=-1)


def with_centres(boxes):
    return np.concatenate([boxes, boxes[..., :2] + boxes[..., 2:] / 2], axis=-1)


def interval_of(particles, place=0.0, size=0.0):
    """95% intervals [2, 1, 6] of x, y, w, h and the centre, given the model's errors."""
    as_boxes = dataclasses.replace(BOXES, shapes=lambda start, substates, tracker: substates)
    places = columns_of(as_boxes, BOXES.start(BOX), particles, [place, place, size])
    names = [*"xywh", "centre_x", "centre_y"]
    ends = [[places[f"{name}_{level}"] for name in names] for level in ("2.5", "97.5")]
    return np.array(ends).transpose(0, 2, 1)


@pytest.mark.parametrize(("place", "size"), [(0.0, 0.0), (0.0, 0.1), (4.0, 0.1), (4.0, 0.0)])
def test_intervals_hold_the_errors_of_place_and_size(place, size):
    rng = np.random.default_rng(2)
    interval = interval_of(draws(rng, 3.0, 0.05), place, size)
    truth = with_centres(draws(rng, np.hypot(3.0, place), np.hypot(0.05, size)))
    held = np.mean((interval[0] <= truth) & (truth <= interval[1]), axis=0)
    # 4.5 standard errors of a share and of two 2.5% quantiles; edges are nearly normal.
    np.testing.assert_allclose(held, 0.95, atol=4.5 * np.sqrt(2 * 0.05 * 0.95 / 20_000) + 0.005)


def test_intervals_of_models_without_such_an_error_are_the_particles():
    particles = draws(np.random.default_rng(2), 3.0, 0.05)
    ends = np.quantile(with_centres(particles), [0.025, 0.975], axis=0, method="inverted_cdf")
    np.testing.assert_allclose(interval_of(particles), ends, atol=0.02)
