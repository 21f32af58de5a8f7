"""Known inputs ``u`` in the functions of a state-space model whose every answer is known."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from exact import LIMIT
from models import space
from pushed import FRAMES, INPUTS, exact, model, z_scores
from records import everything
from refusals import every, message_of

import jaxpf

KEY = jax.random.key(2)
LATER = jax.tree.map(lambda x: x[2:], INPUTS)


@pytest.mark.statistical
def test_evidence_with_inputs_is_that_of_a_kalman_filter():
    evidence = [exact(1.0, frames=FRAMES[: time + 1]).log_evidence for time in range(len(FRAMES))]
    keys = jax.random.split(KEY, 6_000)
    many = jaxpf.monte_carlo(model(num_particles=16), keys, FRAMES, inputs=INPUTS, batch_size=2000)
    ratio = np.exp(np.cumsum(np.asarray(many.log_evidence, float), axis=1) - evidence)
    assert z_scores(ratio, 1).max() < LIMIT
    last = ratio[:, -1] * np.asarray(many.estimate)[:, -1, 0, 0]
    assert z_scores(last, exact(1.0).mean[-1]) < LIMIT


@pytest.mark.statistical
@pytest.mark.slow
def test_smoothing_with_inputs_is_exact():
    mean, _, log_evidence = exact(1.0)
    its = model(num_particles=100)

    def one(key):
        found = jaxpf.smooth(its, key, FRAMES, inputs=INPUTS)
        ratio = jnp.exp(jnp.sum(found.summaries.log_evidence) - log_evidence)
        return ratio * (found.estimate[:, 0, 0] - mean[2:])

    assert z_scores(jax.jit(jax.vmap(one))(jax.random.split(KEY, 40)), 0).max() < LIMIT


@pytest.mark.statistical
@pytest.mark.slow
def test_particle_gibbs_with_inputs_is_exact():
    drawn = jaxpf.smoothing.particle_gibbs(
        model(num_particles=16), KEY, FRAMES, 4200, inputs=INPUTS
    )
    batches = np.asarray(drawn[200:, 1:, 0, 0]).reshape(40, 100, len(FRAMES)).mean(axis=1)
    assert z_scores(batches, exact(1.0).mean[2:]).max() < LIMIT


def test_halves_streams_and_forecasts_read_their_own_rows():
    its = model()
    states, whole = jaxpf.run(its, KEY, FRAMES, everything, inputs=INPUTS)[1]
    half = jax.tree.map(lambda x: x[1], states)
    _, rest = jaxpf.run(its, KEY, FRAMES[2:], state=half, inputs=LATER)
    np.testing.assert_allclose(rest.estimate, whole.estimate[2:], rtol=1e-6)
    rows = (jax.tree.map(lambda x, i=i: x[i], LATER) for i in range(3))
    for given in (LATER, rows):
        streamed = list(jaxpf.stream(its, KEY, FRAMES[2:], state=half, inputs=given))
        np.testing.assert_allclose(streamed[1].summary.estimate, whole.estimate[3], rtol=1e-5)
    pushed = LATER | {"push": LATER["push"] + np.array([10.0, -4.0, 0.0])}
    ahead, further = (
        jaxpf.forecast(its, KEY, half, 3, inputs=given)[1] for given in (LATER, pushed)
    )
    difference = (further.estimate - ahead.estimate)[:, 0, 0]
    np.testing.assert_allclose(difference, [10, 3, 2.1], rtol=1e-4)


@every([
    (lambda: jaxpf.forecast(model(), KEY, model().init(KEY), 6, inputs=INPUTS), "for 6 frames"),
    (lambda: list(jaxpf.stream(model(), KEY, FRAMES, inputs=LATER)), "inputs end before frame 3"),
    (lambda: jaxpf.monte_carlo(model(), KEY[None], iter(FRAMES), inputs=INPUTS), "all at once"),
    (lambda: jaxpf.run(space(), KEY, FRAMES, inputs=INPUTS), "takes no inputs"),
])  # fmt: skip
def test_inputs_that_do_not_fit_are_refused(call, named):
    assert named in message_of(call)
