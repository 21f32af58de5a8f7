"""States that are pytrees, with integers: against a hidden Markov model's sums, and arrays."""

import collections

import jax
import jax.extend
import jax.numpy as jnp
import numpy as np
import pytest
from exact import LIMIT, WRONG
from jax.scipy.stats import norm
from models import partitioned
from refusals import message_of

import jaxpf

KEY = jax.random.key(3)
MATRIX = np.array([[0.8, 0.2, 0.0], [0.1, 0.7, 0.2], [0.3, 0.0, 0.7]])
MEANS = np.array([-1.0, 0.5, 2.0])
FRAMES = np.array([-0.5, 1.2, np.nan, 2.5, 0.1])


def first_regime(key, p):
    return {"regime": jnp.int32(0), "level": jnp.float32(0)}


def next_regime(key, x, p):
    log_rows = jnp.log(jnp.asarray(MATRIX))
    return {"regime": jax.random.categorical(key, log_rows[x["regime"]]), "level": x["level"] + p}


def regime_density(new, x, p):
    return jnp.log(jnp.asarray(MATRIX))[x["regime"], new["regime"]]


def regime_seen(y, x, p):
    return norm.logpdf(y, jnp.asarray(MEANS)[x["regime"]], 1.0)


def switching(**changes):
    settings = {
        "initial": first_regime,
        "transition": next_regime,
        "log_likelihood": regime_seen,
        "transition_log_density": regime_density,
        "parameters": 0.5,
        "num_values": {"regime": 3},
        "num_particles": 30,
        "resampling": "multinomial",
    }
    return jaxpf.state_space(**settings | changes)


def hidden_markov(matrix):
    """Evidence increments, filtered and smoothed probabilities of the regimes."""
    weights = np.array([1.0, 0, 0])
    factors = np.where(np.isnan(FRAMES)[:, None], 1, norm.pdf(FRAMES[:, None], MEANS))
    evidence, filtered = [], []
    for factor in factors:
        weights = weights @ matrix * factor
        evidence.append(weights.sum())
        weights = weights / weights.sum()
        filtered.append(weights)
    backward, smoothed = np.ones(3), []
    for factor, probabilities in zip(factors[::-1], filtered[::-1], strict=True):
        smoothed.append(probabilities * backward / (probabilities @ backward))
        backward = matrix @ (factor * backward)
    return np.log(evidence), np.array(filtered), np.array(smoothed[::-1])


def test_evidence_and_probabilities_of_a_regime_are_those_of_the_hidden_markov_model():
    keys = jax.random.split(KEY, 4000)
    runs = jaxpf.monte_carlo(switching(), keys, FRAMES, batch_size=2000)
    levels = np.broadcast_to(np.arange(1, 6) / 2, (4000, 5))
    np.testing.assert_allclose(runs.estimate["level"], levels, rtol=1e-5)

    def worst_score(matrix):
        evidence, filtered, _ = hidden_markov(matrix)
        ratio = np.exp(np.cumsum(np.asarray(runs.log_evidence, float) - evidence, axis=1))
        parts = ratio[..., None] * np.asarray(runs.estimate["regime"])
        return max(
            np.abs((x.mean(0) - exact) / (x.std(0) / 4000**0.5 + 1e-9)).max()
            for x, exact in ((ratio, np.ones(5)), (parts, filtered))
        )

    assert worst_score(MATRIX) < LIMIT
    assert worst_score(MATRIX[:, [0, 2, 1]]) > WRONG


@pytest.mark.slow
@pytest.mark.parametrize("lag", [pytest.param(None, marks=pytest.mark.always), 4])
def test_smoothed_probabilities_are_those_of_the_hidden_markov_model(lag):
    _, _, smoothed = hidden_markov(MATRIX)
    its = switching(num_particles=1500)
    found = jaxpf.smooth(its, KEY, FRAMES, 1500, lag=lag, paths=0 if lag else 1500)
    np.testing.assert_allclose(found.estimate["regime"], smoothed, atol=0.05)
    np.testing.assert_allclose(found.estimate["level"], np.arange(1, 6) / 2, rtol=1e-5)
    if lag is None:
        regimes = found.paths["regime"]
        assert regimes.dtype == jnp.int32
        shares = (regimes[..., None] == jnp.arange(3)).mean(0)
        np.testing.assert_allclose(shares, found.estimate["regime"], atol=1e-3)


@pytest.mark.slow
def test_every_way_to_run_names_the_leaves():
    its = switching()
    state, whole = jaxpf.run(its, KEY, FRAMES)
    streamed = [each.summary.estimate["regime"] for each in jaxpf.stream(its, KEY, FRAMES)]
    np.testing.assert_allclose(np.array(streamed), whole.estimate["regime"], rtol=1e-5, atol=1e-6)
    _, ahead = jaxpf.forecast(its, KEY, state, 2)
    np.testing.assert_allclose(ahead.estimate["level"], [3.0, 3.5])
    assert its.states(state.substates)["regime"].shape == (30,)


def test_an_integer_without_a_number_of_values_has_a_mean():
    counted = switching(num_values=None)
    state, summary = jaxpf.run(counted, KEY, FRAMES)
    mean = np.exp(state.log_weights) @ counted.states(state.substates)["regime"]
    assert 0 < mean < 2
    np.testing.assert_allclose(summary.estimate["regime"][-1], mean, rtol=1e-4)


# Integers are exact

LARGE = {
    "time": np.int32(1_700_000_000),
    "last": np.int32(2**31 - 6),
    "first": np.int32(-(2**31)),
    "unsigned": np.uint32(2**32 - 6),
    "several": np.int32([3, 2**24 + 1]),
    "x": 0.0,
}


def later(key, x, p):
    moved = jax.tree.map(lambda leaf: leaf + 1, x)
    return moved | {"x": x["x"] + jax.random.normal(key)}


def test_large_integers_are_counted_exactly():
    its = jaxpf.state_space(
        initial=LARGE, transition=later, log_likelihood=lambda y, x, p: norm.logpdf(y, x["x"]),
        num_particles=5,
    )  # fmt: skip
    state, summary = jaxpf.run(its, KEY, FRAMES)
    found = its.states(state.substates)
    for name in LARGE.keys() - {"x"}:
        expected = LARGE[name] + LARGE[name].dtype.type(5)
        np.testing.assert_array_equal(found[name], np.broadcast_to(expected, found[name].shape))
        np.testing.assert_allclose(summary.estimate[name][-1], expected, rtol=1e-6)
        np.testing.assert_allclose(summary.spread[name], 0, atol=1e-3)


def test_an_array_of_large_integers_is_exact():
    its = jaxpf.state_space(
        initial=LARGE["several"], transition=lambda key, x, p: x + 1,
        log_likelihood=lambda y, x, p: 0.0 * y, num_particles=5,
    )  # fmt: skip
    state, summary = jaxpf.run(its, KEY, FRAMES)
    expected = np.broadcast_to(LARGE["several"] + 5, (5, 1, 2))
    np.testing.assert_array_equal(its.states(state.substates), expected)
    np.testing.assert_allclose(summary.estimate[-1], expected[0], rtol=1e-6)


def counter(first):
    return jaxpf.state_space(
        initial=first, transition=lambda key, x, p: x + 1, num_values=3, num_particles=4,
        log_likelihood=lambda y, x, p: 0.0 * y,
    )  # fmt: skip


@jaxpf.pytree_dataclass
class CountsLabels(jaxpf.dynamics.RandomWalk):
    def propagate_label(self, key, label, substates):
        return label + 1


def labelled():
    settings = {"num_particles": 4, "initial_label": np.array([1.0, 0, 0])}
    return partitioned(jaxpf.ordering.sir(1), dynamics=CountsLabels(1.0), **settings)


@pytest.mark.filterwarnings("ignore:the log-likelihood of frame 2 is NaN")
@pytest.mark.parametrize(
    ("its", "frames"),
    [(counter(lambda key, p: jnp.int32(0)), np.ones(4)), (labelled(), np.ones((4, 1, 1)))],
    ids=["value", "label"],
)
def test_an_integer_outside_its_values_is_reported(its, frames):
    """From 0 one more in every frame, so that 1 and 2 are inside, 3 and 4 are not."""
    summary = jaxpf.run(its, KEY, frames)[1]
    invalid = np.asarray(summary.status) & jaxpf.contract.STATUS_INVALID_LIKELIHOOD
    np.testing.assert_array_equal(invalid, [0, 0, 1, 1])
    np.testing.assert_array_equal(summary.num_invalid, [0, 0, 4, 4])


@pytest.mark.parametrize("first", [3, -1, jnp.int32(3)])
def test_a_known_integer_outside_its_values_is_refused(first):
    assert "num_values" in message_of(counter, first)


# Floats by name are the same as an array


def of_array(key, x, p):
    noise = jax.random.normal(key)
    return jnp.stack([x[0] + x[1], 0.9 * x[1] + noise])


def of_tree(key, x, p):
    noise = jax.random.normal(key)
    return {"at": x["at"] + x["speed"], "speed": 0.9 * x["speed"] + noise}


def both():
    by_array = jaxpf.state_space(
        initial=np.zeros(2), transition=of_array,
        log_likelihood=lambda y, x, p: norm.logpdf(y, x[0]),
    )  # fmt: skip
    by_name = jaxpf.state_space(
        initial={"at": 0.0, "speed": 0.0}, transition=of_tree,
        log_likelihood=lambda y, x, p: norm.logpdf(y, x["at"]),
    )  # fmt: skip
    return by_array, by_name


def test_floats_by_name_are_the_numbers_of_an_array():
    by_array, by_name = (jaxpf.run(each, KEY, FRAMES)[1] for each in both())
    for place, name in enumerate(("at", "speed")):
        np.testing.assert_array_equal(by_name.estimate[name], by_array.estimate[:, 0, place])
        np.testing.assert_array_equal(by_name.spread[name], by_array.spread[:, 0, place])


def test_floats_by_name_compute_no_more_than_an_array():
    """Operations of a frame, but for those that only move numbers."""
    moves = {"reshape", "squeeze", "slice", "concatenate", "broadcast_in_dim", "expand_dims"}
    moves |= {"stack", "dynamic_slice", "transpose", "jit"}

    def count(tracker):
        found, todo = collections.Counter(), [
            jax.make_jaxpr(tracker.step)(KEY, tracker.init(KEY), 0.0).jaxpr
        ]  # fmt: skip
        while todo:
            for equation in todo.pop().eqns:
                found[equation.primitive.name] += 1
                todo += jax.extend.core.jaxprs_in_params(equation.params)
        return {name: n for name, n in found.items() if name not in moves}

    by_array, by_name = map(count, both())
    assert by_array == by_name
    assert by_array["exp"]
