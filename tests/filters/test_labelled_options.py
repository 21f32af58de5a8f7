"""The labelled filter as commands see it."""

import numpy as np
from refusals import message_of

import jaxpf
from jaxpf import filters
from jaxpf.contract.model import Model
from jaxpf.detections.records import check_started
from jaxpf.dynamics import AR2
from jaxpf.likelihoods import Gaussian


def model(parents=(-1, -1)):
    eye = np.tile(np.eye(3, dtype=np.float32), (len(parents), 1, 1))
    initial = np.zeros((len(parents), 3), np.float32)
    return Model(AR2(scale=1.0), Gaussian(noise=eye), initial, parents)


def test_options_make_the_tracker_they_describe():
    options = {"weights": "corrected", "feedback": "estimate", "regularise": (0.9, 0.5)}
    tracker = filters.build(model(), method="labelled", num_particles=80, **options)
    assert isinstance(tracker, jaxpf.Labelled)
    chosen = tracker.num_particles, tracker.weights, tracker.feedback
    assert chosen == (80, "corrected", "estimate")
    np.testing.assert_allclose(tracker.regularise, (0.9, 0.5))
    assert tracker.num_partitions == 2
    assert filters.build(model(), method="labelled").regularise is None


def test_parts_of_a_tree_and_too_few_particles_are_refused():
    labelled = filters.filter_of("labelled")
    assert not labelled.admits("labelled", (-1, 0))
    values = {"method": "labelled", "num_particles": 2}
    assert "parts of a tree" in message_of(labelled.check_model, values, (-1, 0))
    assert "3 objects" in message_of(labelled.check_model, values, (-1, -1, -1))


def test_a_start_at_which_a_target_fits_nothing_is_refused():
    check_started([False, False], [3, 7])
    assert "target 7" in message_of(check_started, [False, True], [3, 7])
