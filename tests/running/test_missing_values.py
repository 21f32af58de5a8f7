"""Masked arrays and missing entries of tables mean what NaN means.

``test_doors.py`` passes masked arrays to every function that takes frames.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pandas
import pytest
from jax.scipy.stats import norm
from models import walk
from records import assert_equal

import jaxpf
from jaxpf import likelihoods, tuning
from jaxpf.contract.numbers import with_nan

KEY = jax.random.key(0)
GONE = np.array([0, 0, 1, 0, 1], bool)
WHOLE = np.array([1, -1, 0, 2, 0])
FRAMES = np.where(GONE, np.nan, WHOLE).astype(np.float32)
FLOATS = {
    "masked": np.ma.masked_array(WHOLE.astype(np.float32), GONE),
    "Float32": pandas.Series(WHOLE).astype("Float32").mask(GONE),
    "Series": pandas.Series(FRAMES),
}
KINDS = FLOATS | {
    "masked integers": np.ma.masked_array(WHOLE, GONE),
    "Int64": pandas.Series(WHOLE).astype("Int64").mask(GONE),
    "Float64": pandas.Series(WHOLE).astype("Float64").mask(GONE),
}


ITS = walk(num_particles=8)


@pytest.mark.parametrize("kind", KINDS)
def test_a_missing_value_is_nan(kind):
    np.testing.assert_array_equal(np.asarray(with_nan(KINDS[kind]), np.float32), FRAMES)
    expected = jaxpf.run(ITS, KEY, FRAMES)[1]
    assert_equal(jaxpf.run(ITS, KEY, KINDS[kind])[1], expected)
    assert_equal(tuning.TrainingSequence(ITS, FRAMES, KINDS[kind]).truth, np.float32(FRAMES))


@pytest.mark.parametrize("kind", FLOATS)
def test_a_missing_value_that_comes_alone_is_nan(kind):
    expected = jaxpf.run(ITS, KEY, FRAMES)[1].log_evidence
    many = jaxpf.monte_carlo(ITS, KEY[None], iter(FLOATS[kind])).log_evidence[0]
    streamed = [each.summary.log_evidence for each in jaxpf.stream(ITS, KEY, iter(FLOATS[kind]))]
    for found in (many, streamed):
        np.testing.assert_allclose(found, expected, rtol=1e-5)


def test_the_kalman_filter_takes_tables():
    expected = likelihoods.kalman(*np.ones((4, 1, 1)), [0], [[0]], FRAMES[:, None])
    for frames in (pandas.DataFrame(FLOATS["Float32"]), FLOATS["masked"][:, None]):
        assert_equal(likelihoods.kalman(*np.ones((4, 1, 1)), [0], [[0]], frames), expected)


def of_components(y, x, p):
    seen = ~jnp.isnan(y)
    return jnp.sum(jnp.where(seen, norm.logpdf(jnp.where(seen, y, 0), x), 0))


of_components.handles_nan = True


def test_components_are_missing_in_columns_of_several_kinds():
    its = jaxpf.state_space(
        initial=np.zeros(2),
        transition=lambda key, x, p: x + jax.random.normal(key, (2,)),
        log_likelihood=of_components,
        num_particles=8,
    )
    frames = np.stack([FRAMES, FRAMES[::-1]], axis=1)
    expected = jaxpf.run(its, KEY, frames)[1]
    assert_equal(jaxpf.run(its, KEY, np.ma.masked_invalid(frames))[1], expected)
    table = pandas.DataFrame({"a": KINDS["Int64"], "b": FRAMES[::-1]})
    assert_equal(jaxpf.run(its, KEY, table)[1], expected)
