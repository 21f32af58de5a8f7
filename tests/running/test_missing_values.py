"""Masked arrays and missing entries of tables mean what NaN means, at every door for frames."""

import jax
import jax.numpy as jnp
import numpy as np
import pandas
import pytest
from jax.scipy.stats import norm

import jaxpf
from jaxpf import likelihoods, smoothing, tuning

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


def build(p):
    return jaxpf.state_space(
        initial=0.0,
        transition=lambda key, x, p: x + p * jax.random.normal(key),
        log_likelihood=lambda y, x, p: norm.logpdf(y, x),
        transition_log_density=lambda new, x, p: norm.logpdf(new, x, p),
        parameters=p,
        num_particles=8,
        resampling="multinomial",
    )


def log_prior(p):
    return -p


ITS = build(jnp.float32(1.0))
DOORS = {
    "run": lambda frames: jaxpf.run(ITS, KEY, frames)[1],
    "monte_carlo": lambda frames: jaxpf.monte_carlo(ITS, KEY[None], frames),
    "stream": lambda frames: [each.summary for each in jaxpf.stream(ITS, KEY, frames)],
    "smooth": lambda frames: jaxpf.smooth(ITS, KEY, frames),
    "smooth with a lag": lambda frames: jaxpf.smooth(ITS, KEY, frames, lag=3),
    "smoothing.stream": lambda frames: [
        each.estimate for each in smoothing.stream(ITS, KEY, frames, 3)
    ],
    "particle_gibbs": lambda frames: smoothing.particle_gibbs(ITS, KEY, frames, 2),
    "log_evidence": lambda frames: tuning.log_evidence(ITS, KEY[None], frames),
    "TrainingSequence": lambda frames: tuning.TrainingSequence(ITS, frames, frames).truth,
    "tune": lambda frames: (
        jaxpf.tune(
            tuning.TrainingSequence(ITS, frames), ["parameters=.1:9"],
            settings=tuning.Settings(steps=2, runs=1, repeats=1),
        ).values
    ),
    "pmmh": lambda frames: jaxpf.pmmh(
        build, log_prior, KEY, frames, 1.0, num_draws=3, num_warmup=2, num_chains=1, num_particles=4
    ).parameters,
    "smc2": lambda frames: tuning.smc2(
        build, log_prior, jax.random.exponential, KEY, frames, num_draws=4, num_particles=4
    ).mean,
    "kalman": lambda frames: likelihoods.kalman(
        *np.ones((4, 1, 1)), [0], [[0]], frames if frames.ndim == 2 else frames[:, None]
    ),
}  # fmt: skip
SLOW = {"smooth", "smooth with a lag", "smoothing.stream", "particle_gibbs", "tune", "pmmh", "smc2"}


def assert_alike(found, expected):
    jax.tree.map(np.testing.assert_array_equal, found, expected)


@pytest.mark.parametrize(
    "door", [pytest.param(x, marks=pytest.mark.slow) if x in SLOW else x for x in DOORS]
)
def test_a_missing_value_is_nan(door):
    kinds = KINDS
    if door == "kalman":  # takes a matrix
        kinds = {name: pandas.DataFrame(x) for name, x in FLOATS.items() if name != "masked"}
        kinds["masked"] = FLOATS["masked"][:, None]
    expected = DOORS[door](FRAMES)
    for frames in kinds.values():
        assert_alike(DOORS[door](frames), expected)


@pytest.mark.parametrize("door", ["monte_carlo", "stream"])
def test_a_missing_value_that_comes_alone_is_nan(door):
    expected = DOORS[door](FRAMES)
    for frames in FLOATS.values():
        assert_alike(DOORS[door](iter(frames)), expected)


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
    assert_alike(jaxpf.run(its, KEY, np.ma.masked_invalid(frames))[1], expected)
    table = pandas.DataFrame({"a": KINDS["Int64"], "b": FRAMES[::-1]})
    assert_alike(jaxpf.run(its, KEY, table)[1], expected)
