"""Which trackers have a biased evidence, and what says so."""

import jax
import numpy as np
import pytest
from models import partitioned, walks
from refusals import message_of

import jaxpf
from jaxpf import PFFL, Eskil, Labelled, contract, ordering, tuning
from jaxpf.contract.refusals import biased_evidence
from jaxpf.filters import SideBySide, WithErrorBars
from jaxpf.gradients import Soft

MODEL = walks() | {"initial": np.array([[0], [1]], np.float32)}
SORTED = ordering.sps(num_partitions=2, swap="sorted")


def forest(**settings):
    parents = (-1, -1, 0)
    return partitioned(ordering.sps(parents, **settings), parents=parents)


UNBIASED = {
    "ps": partitioned(ordering.ps([1, 0])),
    "dps": partitioned(ordering.dps(2)),
    "sps": partitioned(ordering.sps(num_partitions=2)),
    "forest": forest(exchange_roots=False),
    "soft": partitioned(SORTED, gradient=Soft()),  # no exchange
    "labelled": Labelled(**MODEL, weights="corrected"),
    "pffl": PFFL(**MODEL),
    "eskil": Eskil(**MODEL, shape="none", drift="none"),
    "proper": Eskil(**MODEL, shape="none", drift="clip", proper=True),
}
BIASED = {
    "swap='sorted'": partitioned(SORTED),
    "roots": forest(),
    "literal": partitioned(ordering.dps(2, reassembly="literal")),
    "equal_share": Labelled(**MODEL),
    "form='literal'": PFFL(**MODEL, form="literal"),
    "shape='relative'": Eskil(**MODEL, drift="none"),
    "drift='clip'": Eskil(**MODEL, shape="none"),
}


def refuse(tracker, tuning=False):
    return biased_evidence(tracker, "it", "leave it", tuning)


@pytest.mark.parametrize("name", UNBIASED)
def test_an_unbiased_evidence_is_not_refused(name):
    assert refuse(UNBIASED[name]) is None


@pytest.mark.parametrize("cause", BIASED)
def test_a_biased_evidence_is_refused_naming_the_cause_and_a_remedy(cause):
    for tracker in (BIASED[cause], SideBySide(BIASED[cause])):
        assert cause in message_of(refuse, tracker)


def test_a_traced_ordering_is_told_apart_inside():
    def inside(tracker):
        return refuse(WithErrorBars(tracker))

    compiled = jax.jit(inside)
    assert compiled(BIASED["swap='sorted'"])
    assert not compiled(UNBIASED["sps"])
    assert not compiled(UNBIASED["ps"])


@pytest.mark.parametrize("cause", ["swap='sorted'", "form='literal'", "shape='relative'"])
def test_tuning_by_an_evidence_of_no_use_is_refused(cause):
    frames = np.zeros((2, 2, 1), np.float32)
    sequence = tuning.TrainingSequence(BIASED[cause], frames)
    assert "'evidence'" in message_of(jaxpf.tune, sequence, ["dynamics.scale"])
    assert refuse(BIASED["literal"], tuning=True) is None  # vanishes with more particles


@pytest.mark.slow
def test_the_error_of_a_grossly_biased_evidence_is_not_known():
    frame = np.zeros((2, 1), np.float32)

    def error(tracker):
        its = SideBySide(tracker)
        return its.step(jax.random.key(0), its.init(jax.random.key(1)), frame)[1].evidence_variance

    error = jax.jit(error)
    assert np.isnan(error(BIASED["swap='sorted'"]))
    assert np.isfinite(error(UNBIASED["sps"]))


def test_a_users_tracker_is_unbiased_unless_it_says_otherwise():
    assert contract.evidence_biases(object()) == ()
