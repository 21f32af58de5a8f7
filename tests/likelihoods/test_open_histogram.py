"""Histograms of places that are filled later, and a detector's word."""

import jax
import numpy as np
import pytest

from jaxpf.contract import log_prob_all
from jaxpf.detections.population import Detected
from jaxpf.likelihoods import histogram
from jaxpf.likelihoods.histogram import open_histogram, with_object

FRAME = np.random.default_rng(0).integers(0, 256, (60, 80, 3), dtype=np.uint8)
FRAME[10:40, 10:30] //= 4
BOXES = np.array([[10.0, 10, 20, 30], [40, 20, 14, 22]])
SUBSTATES = np.array([[20.0, 25, 1], [23, 24, 1.1], [47, 31, 1], [50, 29, 0.9]], np.float32).T
LABELS = np.array([0, 0, 1, 1])


@jax.jit
def log_probs(likelihood, frame, labels):
    return log_prob_all(likelihood, likelihood.observe(frame), labels, SUBSTATES)


def values(likelihood, labels=LABELS):
    return np.asarray(log_probs(likelihood, FRAME, labels))


@pytest.mark.parametrize("method", ["integral", "sampled"])
def test_a_filled_place_is_the_histogram_of_its_box(method):
    known = histogram(FRAME, BOXES, sharpness=7.0, method=method)
    places = open_histogram(3, FRAME.shape[:2], typical_size=(17, 26), sharpness=7.0, method=method)
    for place, box in ((2, BOXES[0]), (0, BOXES[1]), (2, BOXES[1]), (0, BOXES[0])):
        places = with_object(places, place, FRAME, box)
    assert places.distance == known.distance
    found = values(places, np.where(LABELS == 1, 2, 0))
    np.testing.assert_allclose(found, values(known), rtol=1e-4, atol=1e-4)
    assert not np.asarray(places.references)[1].any()


def test_a_detection_pulls_by_its_distance_and_no_farther_than_its_trust():
    plain = histogram(FRAME, BOXES, method="integral")
    found = np.array([[20.0, 25, 1], [np.nan] * 3])
    scale = np.array([[2.0, 3, 0.1], [np.nan] * 3])
    word = values(Detected(plain, found, scale)) - values(plain)
    expected = np.log((np.exp(-0.5 * (1.5**2 + (1 / 3) ** 2 + 1)) + 0.01) / 1.01)
    np.testing.assert_allclose(word, [0, expected, 0, 0], atol=1e-4)
    far = values(Detected(plain, found + 500, scale)) - values(plain)
    np.testing.assert_allclose(far, [np.log(0.01 / 1.01)] * 2 + [0, 0], rtol=1e-4, atol=1e-5)
