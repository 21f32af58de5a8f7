"""Error bars from one run: the filter's answers stay, and what is not known is said."""

import jax
import numpy as np
import pytest
from models import partitioned
from records import everything

import jaxpf
from jaxpf import ordering
from jaxpf.filters import WithErrorBars

FRAMES = np.random.default_rng(0).normal(size=(6, 3, 1)).astype(np.float32)
KEY = jax.random.key(1)


PS, EXCHANGE = ordering.ps([1, 0, 2]), ordering.sps([-1, -1, -1])


def tracker(order=PS, **changes):
    settings = {"num_particles": 64, "resampling": "multinomial"}
    return partitioned(order, **settings | changes)


def told(its, frames=FRAMES, **settings):
    """States and summaries of all frames, with error bars."""
    its = WithErrorBars(its, **settings)
    return jax.device_get(jaxpf.run(its, KEY, frames, everything)[1])


@pytest.mark.slow
@pytest.mark.parametrize("order", [pytest.param(PS, marks=pytest.mark.always), EXCHANGE])
def test_the_filter_answers_as_without(order):
    its = tracker(order)
    _, plain = jaxpf.run(its, KEY, FRAMES)
    _, found = told(its)
    for name in ("estimate", "log_evidence", "distinct_share", "spread"):
        np.testing.assert_array_equal(getattr(found, name), getattr(plain, name))
    assert found.estimate_variance.shape == found.estimate_error.shape == (6, 3, 1)


@pytest.mark.slow
@pytest.mark.always
def test_ancestors_of_the_start_are_handed_on():
    states, _ = told(tracker(PS))
    assert (states.state.sources == states.state.sources[:, :1]).all()  # particles are whole
    ancestor = np.arange(64)
    for source, family in zip(states.state.sources[:, 0], states.families, strict=True):
        ancestor = ancestor[source]
        np.testing.assert_array_equal(family[0, 0], ancestor)


@pytest.mark.slow
def test_exchanged_parts_have_ancestors_of_their_own_and_no_error_bar_of_the_evidence():
    states, summary = told(tracker(EXCHANGE))
    assert states.families.shape == (6, 1, 3, 64)
    assert (states.state.sources[-1, 0] != states.state.sources[-1, 1]).any()
    ancestor = np.arange(64)
    for source in states.state.sources[:, 2]:
        ancestor = ancestor[source]
    np.testing.assert_array_equal(states.families[-1, 0, 2], ancestor)
    assert np.isnan(summary.evidence_variance).all()
    assert np.isfinite(summary.estimate_variance[0]).all()


@pytest.mark.slow
@pytest.mark.always
def test_the_evidence_has_an_error_bar_with_multinomial_draws_alone():
    known, unknown = (told(tracker(resampling=x))[1] for x in ("multinomial", "systematic"))
    assert np.isfinite(known.evidence_variance).any()
    assert np.isnan(unknown.evidence_variance).all()
    assert np.isfinite(unknown.estimate_variance).all()


@pytest.mark.parametrize(
    ("ess_threshold", "num_frames", "generations"),
    [
        pytest.param(0.0, 4, 1, id="the first draws alone"),
        pytest.param(1.0, 1, 3, id="a selection after every stage"),
        pytest.param(None, 1, 3, id="not adaptive"),
    ],
)
def test_bars_are_those_computed_by_hand(ess_threshold, num_frames, generations):
    """Of families by hand, over so many generations of particles."""
    its = tracker(ess_threshold=ess_threshold)
    states, summary = told(its, 0.3 * FRAMES)
    last = num_frames - 1
    family = np.arange(64)
    for source in states.state.sources[:num_frames, 0]:
        family = family[source]
    weights = np.exp(states.state.log_weights[last].astype(float))
    values = states.state.lagged[last, 0, 0].astype(float)  # [P, N]
    parts = (values - (values @ weights)[:, None]) * weights
    sums, shares = (
        np.array([x[..., family == ancestor].sum(axis=-1) for ancestor in range(64)])
        for x in (parts, weights)
    )
    growth = (64 / 63) ** generations
    of_estimate = growth * (sums**2).sum(axis=0)
    of_evidence = 1 - growth * (1 - (shares**2).sum())
    assert of_evidence > 0
    np.testing.assert_allclose(summary.estimate_variance[last, :, 0], of_estimate, rtol=1e-3)
    np.testing.assert_allclose(summary.evidence_variance[last], of_evidence, rtol=1e-3)


#: So many that all particles come from one.
LONG = np.tile(FRAMES, (7, 1, 1))


@pytest.mark.slow
def test_what_is_not_known_is_not_zero():
    _, summary = told(tracker(num_particles=16), LONG)
    assert np.isnan(summary.estimate_variance[-1]).all()
    assert np.isnan(summary.evidence_variance[-1])
    assert summary.unknown[-1].all()
    assert (summary.num_ancestors[-1] == 1).all()


@pytest.mark.slow
def test_a_lag_keeps_error_bars_alive_and_says_nothing_of_the_evidence():
    states, summary = told(tracker(num_particles=400), LONG, lag=2)
    known = np.isfinite(summary.estimate_variance)
    assert known.mean() > 0.9
    assert (summary.estimate_variance[known] > 0).all()
    assert np.isnan(summary.evidence_variance[3:]).all()
    # Ancestors are those of its frame; stage 0 is the turn of partition 1.
    first_drawn, sources = states.state.lineage[:, 1], states.state.sources
    two_back = first_drawn[3][sources[4, 0]][sources[5, 0]]
    np.testing.assert_array_equal(states.families[5, 2, 0], two_back)
