"""The labelled filter as commands see it."""

import dataclasses

import numpy as np
from refusals import message_of

import jaxpf
from jaxpf.contract import Model
from jaxpf.dynamics import AR2
from jaxpf.filters.labelled.family import LABELLED
from jaxpf.filters.labelled.options import Options
from jaxpf.filters.labelled.refusals import check_started
from jaxpf.likelihoods import Gaussian


def model(num_targets=2):
    eye = np.tile(np.eye(3, dtype=np.float32), (num_targets, 1, 1))
    initial = np.zeros((num_targets, 3), np.float32)
    return Model(AR2(scale=1.0), Gaussian(noise=eye), initial, (-1,) * num_targets)


def test_options_make_the_tracker_they_describe():
    options = Options(
        num_particles=80, weights="corrected", feedback="estimate", regularise=(0.9, 0.5)
    )
    tracker = LABELLED.tracker(model(), options)
    assert isinstance(tracker, jaxpf.Labelled)
    chosen = tracker.num_particles, tracker.weights, tracker.feedback
    assert chosen == (80, "corrected", "estimate")
    np.testing.assert_allclose(tracker.regularise, (0.9, 0.5))
    assert tracker.num_partitions == 2
    assert LABELLED.tracker(model(), Options()).regularise is None


def test_parts_of_a_tree_and_too_few_particles_are_refused():
    assert not LABELLED.admits("labelled", (-1, 0))
    assert "parts of a tree" in message_of(LABELLED.check, vars(Options()), (-1, 0))
    assert "2 objects" in message_of(LABELLED.check, vars(Options(num_particles=1)), (-1, -1))


def test_a_start_at_which_a_target_fits_nothing_is_refused():
    @dataclasses.dataclass
    class Summary:
        without_likelihood: list

    check_started(Summary([False, False]))
    assert "target 7" in message_of(check_started, Summary([False, True]), ids=[3, 7])
