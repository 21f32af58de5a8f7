"""Simulated detections: misses, false alarms and jitter as stated."""

import numpy as np
import pytest

from jaxpf.evaluation.baselines.simulated_detections import simulated_detections

SHAPE = (300, 400)


@pytest.fixture(scope="module")
def truth():
    """Five boxes in 2000 frames, the last one in every second frame."""
    boxes = np.tile(np.array([[20.0, 30, 40, 80]]), (2000, 5, 1))
    boxes[..., 0] += 70 * np.arange(5)
    boxes[::2, 4] = np.nan
    return boxes


def test_as_many_are_missed_and_invented_as_was_said(truth):
    number = int(np.isfinite(truth[..., 0]).sum())
    found = simulated_detections(truth, SHAPE, misses=0.2, false_alarms=0, jitter=0.0)
    kept = sum(map(len, found))
    assert abs(kept - 0.8 * number) < 4.5 * (number * 0.2 * 0.8) ** 0.5
    false = simulated_detections(truth, SHAPE, misses=1.0, false_alarms=0.5)
    count = np.array([len(boxes) for boxes in false])
    assert abs(count.mean() - 0.5) < 4.5 * (0.5 / len(truth)) ** 0.5
    assert abs(count.var() - 0.5) < 0.1  # Poisson
    boxes = np.concatenate(false)
    assert np.all(boxes[:, 2:] == [40, 80])
    corner = boxes[:, :2] / (np.array(SHAPE[::-1]) - [40, 80])
    assert np.all((corner >= 0) & (corner <= 1))
    error = np.sqrt(1 / 12 / len(boxes))
    assert np.all(np.abs(corner.mean(axis=0) - 0.5) < 4.5 * error)


def test_jitter_is_a_share_of_the_size_and_has_no_direction(truth):
    found = simulated_detections(truth[:, :1], SHAPE, misses=0, false_alarms=0, jitter=0.05, seed=1)
    boxes = np.concatenate(found)
    assert len(boxes) == len(truth)
    off = (boxes[:, :2] + boxes[:, 2:] / 2 - [40, 70]) / [40, 80]
    both = np.hstack([off, np.log(boxes[:, 2:] / [40, 80])])
    assert np.all(np.abs(both.mean(axis=0)) < 4.5 * 0.05 / len(boxes) ** 0.5)
    np.testing.assert_allclose(both.std(axis=0), 0.05, rtol=4.5 / (2 * len(boxes)) ** 0.5)


def test_a_seed_gives_the_same_detections_and_another_seed_others(truth):
    one, same, other = (simulated_detections(truth[:20], SHAPE, seed=seed) for seed in (0, 0, 1))
    assert all(np.array_equal(a, b) for a, b in zip(one, same, strict=True))
    assert any(len(a) != len(b) for a, b in zip(one, other, strict=True))
