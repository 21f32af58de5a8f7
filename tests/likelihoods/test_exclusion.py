"""Boxes that exclude one another: the joint likelihood, counted in the plainest way."""

import jax
import numpy as np
import pytest
from histograms import texture

from jaxpf.likelihoods import discriminative
from jaxpf.likelihoods.exclusion import excluding

FRAME = texture(0, 70, 95, 5)
BOXES = np.array([[20.0, 12.0, 44.0, 40.0], [60.0, 40.0, 14.0, 22.0]])
OBJECTS = np.concatenate([BOXES, BOXES[:1] + np.array([3, 3, 0, 0])])


@pytest.fixture(scope="module")
def exclusive():
    return excluding(discriminative(FRAME, OBJECTS))


def substates_of(boxes):
    """``[P, 3]`` of boxes that are as large as at the start."""
    return np.column_stack([boxes[:, :2] + boxes[:, 2:] / 2, np.ones(len(boxes))])


@pytest.mark.slow
def test_what_the_one_in_front_takes_counts_as_background(exclusive):
    rng = np.random.default_rng(0)
    own = rng.normal(10, 8, 3)
    boxes = OBJECTS + np.append(rng.uniform(-3, 3, (3, 2)), np.zeros((3, 2)), axis=1)
    expected = own.sum()
    for i, j in ((0, 1), (0, 2), (1, 2)):
        first, last = boxes[[i, j], :2], boxes[[i, j], :2] + boxes[[i, j], 2:]
        shared = np.maximum(last.min(axis=0) - first.max(axis=0), 0).prod()
        hidden = np.clip((shared / boxes[[i, j], 2:].prod(axis=1) - 0.7) / 0.25, 0, 1)
        in_front = [own[i] + (1 - hidden[1]) * own[j], (1 - hidden[0]) * own[i] + own[j]]
        expected += np.log(np.mean(np.exp(in_front))) - own[i] - own[j]
    assert abs(expected - own.sum()) > 1
    log_joint = jax.jit(type(exclusive).log_joint)
    joint = log_joint(exclusive, None, substates_of(boxes).astype(np.float32), own)
    assert float(joint) == pytest.approx(expected, abs=1e-3)


def test_who_is_hidden_costs_nothing_and_boxes_apart_are_judged_alone(exclusive):
    own = np.array([60.0, -9.0, 30.0])
    every = np.stack([substates_of(OBJECTS)] * 3)
    every[:, 1, :2] = every[:, 0, :2]  # the small second object in the middle of the first
    every[:, 2, :2] += 500  # the third far away
    every[1, 2, :2] = every[1, 0, :2]  # or, in the second particle, in the place of the first
    every[2, :, 0] += [0, 900, 1900]  # or, in the third, all apart
    substates = np.moveaxis(every, 0, -1).astype(np.float32)
    log_joint_all = jax.jit(type(exclusive).log_joint_all)
    joint = log_joint_all(exclusive, None, substates, np.repeat(own[:, None], 3, axis=1))
    assert float(joint[0]) == pytest.approx(60 + 30 - np.log(2), abs=1e-3)
    # Of two in one place the better counts; and in front of the second either may be.
    assert float(joint[1]) == pytest.approx(60 + 9 - 2 * np.log(2) - np.log(2), abs=0.1)
    assert float(joint[2]) == pytest.approx(own.sum(), abs=1e-3)
