"""Error bars from one run: the filter's answers stay, and what is not known is said."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxpf
from jaxpf import ordering
from jaxpf.dynamics import RandomWalk
from jaxpf.filters import WithErrorBars
from jaxpf.likelihoods import Gaussian

FRAMES = np.random.default_rng(0).normal(size=(6, 3, 1)).astype(np.float32)
KEY = jax.random.key(1)


def tracker(order=None, **changes):
    settings = {
        "dynamics": RandomWalk(scale=1.0),
        "likelihood": Gaussian(noise=jnp.ones((3, 1, 1))),
        "ordering": ordering.ps([1, 0, 2]) if order is None else order,
        "initial": jnp.zeros((3, 1)),
        "num_particles": 64,
    }
    return jaxpf.Partitioned(**settings | changes)


@pytest.mark.parametrize("order", [ordering.ps([1, 0, 2]), ordering.sps([-1, -1, -1])])
def test_the_filter_answers_as_without(order):
    its = tracker(order)
    _, plain = jaxpf.run(its, KEY, FRAMES)
    _, told = jaxpf.run(WithErrorBars(its), KEY, FRAMES)
    for name in ("estimate", "log_evidence", "uniqueness", "spread"):
        assert jnp.array_equal(getattr(told, name), getattr(plain, name))
    assert told.estimate_variance.shape == told.estimate_error.shape == (6, 3, 1)


def families_by_hand(order, **settings):
    """Ancestors of the particles in the first frame, from what the filter drew frame by frame."""
    its = WithErrorBars(tracker(order), **settings)
    _, states = jaxpf.run(its, KEY, FRAMES, lambda state, summary: state)
    return states, np.asarray(states.state.sources), np.asarray(states.families)


def test_ancestors_of_the_start_are_handed_on():
    _, sources, families = families_by_hand(ordering.ps([1, 0, 2]))
    assert (sources == sources[:, :1]).all()  # particles are whole
    ancestor = np.arange(64)
    for source, family in zip(sources[:, 0], families, strict=True):
        ancestor = ancestor[source]
        np.testing.assert_array_equal(family[0, 0, 0], ancestor)


def test_ancestors_of_a_lag_are_those_of_its_frame():
    states, sources, families = families_by_hand(ordering.ps([1, 0, 2]), lag=2)
    first_drawn = np.asarray(states.state.lineage)[:, 1]  # stage 0 is the turn of partition 1
    two_back = first_drawn[3][sources[4, 0]][sources[5, 0]]
    np.testing.assert_array_equal(families[5, 2, 0, 0], two_back)


def test_exchanged_parts_have_ancestors_of_their_own():
    _, sources, families = families_by_hand(ordering.sps([-1, -1, -1]))
    assert families.shape == (6, 1, 1, 3, 64)
    assert (sources[-1, 0] != sources[-1, 1]).any()
    ancestor = np.arange(64)
    for source in sources[:, 2]:
        ancestor = ancestor[source]
    np.testing.assert_array_equal(families[-1, 0, 0, 2], ancestor)


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
    its = WithErrorBars(tracker(resampling="multinomial", ess_threshold=ess_threshold))
    _, (states, summary) = jaxpf.run(its, KEY, 0.3 * FRAMES[:num_frames], lambda *both: both)
    family = np.arange(64)
    for source in np.asarray(states.state.sources)[:, 0]:
        family = family[source]
    weights = np.exp(np.asarray(states.state.log_weights[-1], float))
    values = np.asarray(states.state.lagged[-1, 0, 0], float)  # [P, N]
    parts = (values - (values @ weights)[:, None]) * weights
    sums, shares = (
        np.array([x[..., family == ancestor].sum(axis=-1) for ancestor in range(64)])
        for x in (parts, weights)
    )
    growth = (64 / 63) ** generations
    of_estimate = growth * (sums**2).sum(axis=0)
    of_evidence = 1 - growth * (1 - (shares**2).sum())
    assert of_evidence > 0
    np.testing.assert_allclose(summary.estimate_variance[-1, :, 0], of_estimate, rtol=1e-3)
    np.testing.assert_allclose(summary.evidence_variance[-1], of_evidence, rtol=1e-3)


def test_what_is_not_known_is_not_zero():
    # Nobody is left but the children of one: 40 frames for 16 particles.
    frames = np.tile(FRAMES, (7, 1, 1))
    its = WithErrorBars(tracker(num_particles=16, resampling="multinomial"))
    _, told = jaxpf.run(its, KEY, frames)
    assert np.isnan(told.estimate_variance[-1]).all()
    assert np.isnan(told.evidence_variance[-1])
    assert told.unknown[-1].all()
    assert (told.num_ancestors[-1] == 1).all()
    # A lag keeps the estimate's error bars alive, and says nothing of the evidence.
    _, lagged = jaxpf.run(
        WithErrorBars(tracker(num_particles=64, resampling="multinomial"), lag=1), KEY, frames
    )
    assert np.isfinite(lagged.estimate_variance).mean() > 0.9
    assert (lagged.estimate_variance[np.isfinite(lagged.estimate_variance)] > 0).all()
    assert np.isnan(lagged.evidence_variance[2:]).all()


def test_the_evidence_of_exchanged_parts_has_no_error_bar():
    _, told = jaxpf.run(WithErrorBars(tracker(ordering.sps([-1, -1, -1]))), KEY, FRAMES)
    assert np.isnan(told.evidence_variance).all()
    assert np.isfinite(told.estimate_variance[0]).all()


def test_the_evidence_has_an_error_bar_with_multinomial_draws_alone():
    known = {
        scheme: jaxpf.run(WithErrorBars(tracker(resampling=scheme)), KEY, FRAMES)[1]
        for scheme in ("multinomial", "systematic")
    }
    assert np.isfinite(known["multinomial"].evidence_variance).any()
    assert np.isnan(known["systematic"].evidence_variance).all()
    assert np.isfinite(known["systematic"].estimate_variance).all()


@pytest.mark.parametrize("order", [[0, 1, 2], [2, 1, 0]])
def test_the_stage_of_the_sharpest_likelihood_makes_most_of_the_error(order):
    noise = jnp.array([0.05, 3.0, 3.0])[:, None, None]
    its = tracker(
        ordering.ps(order),
        likelihood=Gaussian(noise=noise),
        num_particles=400,
        resampling="multinomial",
    )
    _, told = jaxpf.run(WithErrorBars(its, lag=1, stages=True), KEY, FRAMES)
    assert (np.asarray(told.evidence_terms)[:2].argmax(axis=-1) == order.index(0)).all()
