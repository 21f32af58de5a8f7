"""Known inputs ``u`` and the time of a frame in the functions of a state-space model."""

import jax
import numpy as np
import pytest
from exact import LIMIT, rauch_tung_striebel

import jaxpf
from jaxpf import InputError
from jaxpf.likelihoods import kalman

KEY = jax.random.key(2)
#: A push that the state feels, and an offset of the sensor that the observation shows.
INPUTS = {
    "push": np.array([3.0, -2.0, 1.0, 4.0]),
    "offset": np.array([[1.0], [5.0], [-3.0], [2.0]]),
}
STATES = np.cumsum(INPUTS["push"])
FRAMES = STATES + INPUTS["offset"][:, 0] + np.array([0.3, -0.8, 0.5, 0.1])
LATER = jax.tree.map(lambda x: x[2:], INPUTS)


def start(key, p):
    return jax.random.normal(key)


def transition(key, x, p, u):
    return x + p * u["push"] + jax.random.normal(key)


def density(new, x, p, u):
    return jax.scipy.stats.norm.logpdf(new, x + p * u["push"])


def log_likelihood(y, x, p, u, time):
    return jax.scipy.stats.norm.logpdf(y, x + u["offset"][0], 1.0 + 0.5 * (time == 1))


def model(parameters=1.0, **changes):
    settings = {
        "initial": start,
        "transition": transition,
        "log_likelihood": log_likelihood,
        "transition_log_density": density,
        "num_particles": 16,
        "resampling": "multinomial",
    }
    return jaxpf.state_space(parameters=parameters, **settings | changes)


def exact():
    """Evidence of every frame, and smoothed means: the push taken out of state and observation."""
    one, evidence, means, variances = np.eye(1), [], [], []
    mean, variance = np.zeros(1), one
    for time, y in enumerate(FRAMES - STATES - INPUTS["offset"][:, 0]):
        noise = (1.0 + 0.5 * (time == 1)) ** 2 * one
        log_evidence, m, v = kalman(one, one, one, noise, mean, variance, np.array([[y]]))
        mean, variance = m[0], v[0]
        evidence.append(log_evidence[0])
        means.append(mean)
        variances.append(variance)
    smoothed = rauch_tung_striebel(one, one, np.array(means), np.array(variances))[0]
    return np.array(evidence), smoothed[:, 0] + STATES


@pytest.mark.statistical
def test_evidence_with_inputs_is_that_of_a_kalman_filter():
    evidence, _ = exact()
    keys = jax.random.split(KEY, 6_000)
    many = jaxpf.monte_carlo(model(), keys, FRAMES, inputs=INPUTS, batch_size=2000)
    ratio = np.exp(np.cumsum(np.asarray(many.log_evidence, float) - evidence, axis=1))
    error = ratio.std(axis=0) / len(keys) ** 0.5
    assert np.abs((ratio.mean(axis=0) - 1) / error).max() < LIMIT
    assert np.abs(np.asarray(many.estimate)[..., 0, 0].mean(axis=0)[-1] - STATES[-1]) < 1


@pytest.mark.statistical
@pytest.mark.slow
def test_smoothing_with_inputs_is_exact():
    _, smoothed = exact()
    its = model(num_particles=100)
    means = jax.jit(
        jax.vmap(lambda key: jaxpf.smooth(its, key, FRAMES, inputs=INPUTS).estimate[:, 0, 0])
    )(jax.random.split(KEY, 40))
    error = means.std(axis=0) / len(means) ** 0.5
    assert np.abs((means.mean(axis=0) - smoothed) / error).max() < LIMIT


def test_halves_streams_and_forecasts_read_their_own_rows():
    its = model()
    states, whole = jaxpf.run(its, KEY, FRAMES, lambda *both: both, inputs=INPUTS)[1]
    half = jax.tree.map(lambda x: x[1], states)
    _, rest = jaxpf.run(its, KEY, FRAMES[2:], state=half, inputs=LATER)
    np.testing.assert_allclose(rest.estimate, whole.estimate[2:], rtol=1e-6)
    rows = (jax.tree.map(lambda x, i=i: x[i], LATER) for i in range(2))
    for given in (LATER, rows):
        streamed = list(jaxpf.stream(its, KEY, FRAMES[2:], state=half, inputs=given))
        np.testing.assert_allclose(streamed[1].summary.estimate, whole.estimate[3], rtol=1e-5)
    pushed = LATER | {"push": LATER["push"] + np.array([10.0, -4.0])}
    ahead, further = (
        jaxpf.forecast(its, KEY, half, 2, inputs=given)[1] for given in (LATER, pushed)
    )
    difference = (further.estimate - ahead.estimate)[:, 0, 0]
    np.testing.assert_allclose(difference, [10, 6], rtol=1e-4)


@pytest.mark.slow
def test_smoothing_with_a_lag_reads_the_rows_of_its_blocks():
    its = model(num_particles=64)
    one, other = (
        jaxpf.smooth(its, KEY, FRAMES, 4000, lag=lag, inputs=INPUTS).estimate for lag in (None, 4)
    )
    np.testing.assert_allclose(one, other, atol=0.2)


@pytest.mark.statistical
@pytest.mark.slow
def test_particle_gibbs_with_inputs_is_exact():
    _, smoothed = exact()
    drawn = jaxpf.smoothing.particle_gibbs(model(), KEY, FRAMES, 4200, inputs=INPUTS)
    batches = np.asarray(drawn[200:, 1:, 0, 0]).reshape(40, 100, len(FRAMES)).mean(axis=1)
    error = batches.std(axis=0, ddof=1) / 40**0.5
    assert np.abs((batches.mean(axis=0) - smoothed) / error).max() < LIMIT


@pytest.mark.slow
def test_the_posterior_of_the_gain_of_an_input():
    def prior(p):
        return jax.scipy.stats.norm.logpdf(p, 1.0, 1.0)

    def build(p):
        return model(p)

    posterior = jaxpf.pmmh(
        build, prior, KEY, FRAMES, 0.8, inputs=INPUTS,
        num_draws=100, num_warmup=50, num_chains=2, num_particles=32,
    )  # fmt: skip
    assert 0.6 < np.mean(posterior.parameters) < 1.4


def test_inputs_that_do_not_fit_are_refused():
    its, state = model(), model().init(KEY)
    none = jaxpf.state_space(
        initial=np.zeros(()),
        transition=lambda key, x, p: x + jax.random.normal(key),
        log_likelihood=lambda y, x, p: -((y - x) ** 2),
    )
    for call, said in (
        (
            lambda: jaxpf.forecast(its, KEY, state, 5, inputs=INPUTS),
            r"inputs\['offset'\] has shape \[4, 1\] for 5 frames; give a row for each, \[5, ...\]",
        ),
        (
            lambda: list(jaxpf.stream(its, KEY, FRAMES, inputs=LATER)),
            "inputs end before frame 2; give a row for each frame",
        ),
        (
            lambda: jaxpf.monte_carlo(its, KEY[None], iter(FRAMES), inputs=INPUTS),
            "frames come one by one, and are needed all at once",
        ),
        (lambda: jaxpf.run(none, KEY, FRAMES, inputs=INPUTS), "takes no inputs; let a function"),
    ):
        with pytest.raises(InputError, match=said):
            call()
