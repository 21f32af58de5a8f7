"""The labelled filter as commands see it, and trackers of labelled boxes."""

import dataclasses

import numpy as np
import pytest

import jaxpf
from jaxpf.filters.labelled.options import LABELLED, Options
from jaxpf.filters.labelled.refusals import check_started
from jaxpf.models.dynamics import AR2
from jaxpf.models.likelihoods import Gaussian
from jaxpf.models.model import Model
from jaxpf.targets.labelled_boxes import check_in_frame, labelled_box_tracker

BOXES = np.array([[10.0, 20, 8, 12], [40, 30, 6, 6]])


def model(num_targets=2):
    eye = np.tile(np.eye(3, dtype=np.float32), (num_targets, 1, 1))
    initial = np.zeros((num_targets, 3), np.float32)
    return Model(AR2(scale=1.0), Gaussian(noise=eye), initial, (-1,) * num_targets)


def test_options_make_the_tracker_they_describe():
    options = Options(particles=80, weights="corrected", feedback="estimate", regularise=(0.9, 0.5))
    tracker = LABELLED.tracker(model(), options)
    assert isinstance(tracker, jaxpf.Labelled)
    assert (tracker.num_particles, tracker.weights, tracker.feedback) == (
        80,
        "corrected",
        "estimate",
    )
    np.testing.assert_allclose(tracker.regularise, (0.9, 0.5))
    assert tracker.num_partitions == 2
    assert LABELLED.tracker(model(), Options()).regularise is None


def test_parts_of_a_tree_and_too_few_particles_are_refused():
    assert not LABELLED.admits("labelled", (-1, 0))
    with pytest.raises(jaxpf.InputError, match="parts of a tree"):
        LABELLED.check(Options(), (-1, 0))
    with pytest.raises(jaxpf.InputError, match="fewer than the 2 objects"):
        LABELLED.check(Options(particles=1), (-1, -1))
    with pytest.raises(jaxpf.InputError, match="regularise"):
        Options(regularise=(0.0, 0.5))
    with pytest.raises(jaxpf.InputError, match="weights"):
        Options(weights="fair")


def test_boxes_start_at_their_centres_at_scale_1():
    tracker = labelled_box_tracker(model().likelihood, BOXES, num_particles=50)
    np.testing.assert_allclose(tracker.initial, [[14, 26, 1], [43, 33, 1]])
    assert (tracker.weights, tracker.feedback, tracker.scope) == ("equal_share", "none", "across")


@pytest.mark.parametrize(
    ("box", "sentence"),
    [
        ((200.0, 20, 8, 12), "target 1 has the box 200,20,8,12, which lies outside"),
        ((10.0, -30, 8, 12), "outside the frame of 100 x 80"),
        ((10.0, 20, 0, 12), "has no area"),
        ((np.nan, 20, 8, 12), "has no area"),
    ],
)
def test_a_box_that_nobody_can_see_is_refused(box, sentence):
    boxes = np.array([BOXES[0], box])
    with pytest.raises(jaxpf.InputError, match=sentence):
        labelled_box_tracker(model().likelihood, boxes, frame_shape=(80, 100, 3))
    with pytest.raises(jaxpf.InputError, match="target b"):
        check_in_frame(boxes, (80, 100), ids=["a", "b"])


def test_a_start_at_which_a_target_fits_nothing_is_refused():
    @dataclasses.dataclass
    class Summary:
        lost: list

    check_started(Summary([False, False]))
    with pytest.raises(jaxpf.InputError, match="no particle of target 7 has any likelihood"):
        check_started(Summary([False, True]), ids=[3, 7])
