"""Models from plain functions: the same filters as from classes, and what they refuse."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from exact import LIMIT, WRONG
from jax.scipy.stats import norm
from models import VALUES, initial, log_density, log_likelihood, space
from records import assert_equal, z_score
from refusals import message_of

import jaxpf
from jaxpf import contract
from jaxpf.likelihoods import kalman
from jaxpf.proposals import Mixture
from jaxpf.running.runs import run_compiled
from jaxpf.tuning.parameters import names

KEY = jax.random.key(0)
FRAMES = 1.5 * np.random.default_rng(0).normal(size=6)


@jaxpf.pytree_dataclass
class Walk(contract.DynamicsWithDensity):
    a: float
    s: float

    def propagate(self, key, partition, current, previous, parent):
        return self.a * current + self.s * jax.random.normal(key)

    def log_density(self, partition, new, current, previous, parent):
        return norm.logpdf(new[0], self.a * current[0], self.s)


@jaxpf.pytree_dataclass
class Seen(contract.Likelihood):
    noise: float

    def log_prob(self, observation, partition, substate):
        return norm.logpdf(observation, substate[0], self.noise)


@jaxpf.pytree_dataclass
class Start:
    s: float
    independent = True

    def __call__(self, key):
        return self.s * jax.random.normal(key, (1, 1))


def by_classes():
    return jaxpf.Partitioned(
        dynamics=Walk(VALUES["a"], VALUES["s"]),
        likelihood=Seen(VALUES["noise"]),
        initial=Start(VALUES["s"]),
        ordering=jaxpf.ordering.sir(1),
        num_particles=50,
    )


# The same as classes, which are compared with exact filters elsewhere


def test_functions_filter_as_classes_do_bit_for_bit():
    assert_equal(*(jaxpf.run(its, KEY, FRAMES)[1] for its in (space(), by_classes())))


@pytest.mark.slow
def test_functions_smooth_as_classes_do_bit_for_bit():
    functions = space(transition_log_density=log_density)
    frames = np.where(np.arange(6) == 3, np.nan, FRAMES)
    smoothed = [jaxpf.smooth(each, KEY, frames) for each in (functions, by_classes())]
    assert_equal(*(each.summaries for each in smoothed))
    assert_equal(*(each.estimate for each in smoothed))


def test_the_state_may_have_any_shape():
    flat = jaxpf.run(space(), KEY, FRAMES)[1].estimate
    square = space(
        initial=lambda key, p: jnp.full((2, 2), initial(key, p)),
        log_likelihood=lambda y, x, p: log_likelihood(y, x[1, 0], p),
    )
    estimate = jaxpf.run(square, KEY, FRAMES)[1].estimate
    assert estimate.shape == (6, 1, 4)
    np.testing.assert_allclose(estimate, np.broadcast_to(flat, estimate.shape), rtol=1e-5)
    known = space(initial=0.25)
    np.testing.assert_array_equal(known.init(KEY).substates, 0.25)


def test_a_transition_may_ask_for_the_time_and_for_the_state_before():
    def line(key, x, p, previous, time):
        return 2 * x - previous + (time == 2)

    tracker = space(
        parameters=None, initial=1.0, transition=line, log_likelihood=lambda y, x, p: 0.0
    )
    estimate = jaxpf.run(tracker, KEY, FRAMES)[1].estimate
    np.testing.assert_allclose(estimate[:, 0, 0], [1, 1, 2, 3, 4, 5], rtol=1e-5)


def both_log_likelihood(y, x, p, previous):
    """Of y = x + b x_before + n."""
    return norm.logpdf(y, x + p["b"] * previous, p["noise"])


def sees_both(b=0.8, **changes):
    model = {"log_likelihood": both_log_likelihood, "transition_log_density": log_density}
    return space(parameters=VALUES | {"b": b}, **model | changes)


def evidence_and_first(state, summary):
    return summary.log_evidence, summary.estimate[0]


def kalman_of_both(frames):
    """Kalman on (x, x_before), where y = x + .8 x_before + n."""
    a, s, noise = VALUES.values()
    return kalman(
        np.array([[a, 0], [1, 0]]), np.diag([s**2, 0]), np.array([[1, 0.8]]),
        np.array([[noise**2]]), np.zeros(2), np.full((2, 2), s**2), frames[:, None],
    )  # fmt: skip


@jaxpf.pytree_dataclass
class Optimal:
    """The posterior of a state given the one before and the frame."""

    def moments(self, y, current):
        a, s, noise = VALUES.values()
        variance = 1 / (1 / s**2 + 1 / noise**2)
        return variance * (a * current / s**2 + y / noise**2), variance**0.5

    def propose(self, key, observation, partition, current, previous, parent):
        mean, scale = self.moments(observation, current)
        return mean + scale * jax.random.normal(key, current.shape)

    def log_density(self, observation, partition, new, current, previous, parent):
        return norm.logpdf(new, *self.moments(observation, current)).sum()


@pytest.mark.parametrize(
    ("coefficient", "proposal", "is_right"),
    [
        (0.8, None, True),
        pytest.param(0.5, None, False, marks=pytest.mark.slow),
        pytest.param(0.8, Optimal(), True, marks=pytest.mark.slow),
        pytest.param(0.8, Mixture(Optimal(), 0.5), True, marks=pytest.mark.slow),
    ],
)
def test_a_likelihood_that_sees_the_state_before_has_the_exact_evidence(
    coefficient, proposal, is_right
):
    """z-scores of evidence and means."""
    with jax.enable_x64(True):
        keys = jax.random.split(jax.random.key(1), 8000)
        its = sees_both(coefficient, proposal=proposal)
        runs = jaxpf.monte_carlo(its, keys, FRAMES, evidence_and_first, batch_size=2000)
        log_evidence, estimate = map(np.asarray, runs)
    exact, mean, _ = kalman_of_both(FRAMES)
    ratio = np.exp(log_evidence.sum(1) - exact.sum())
    of_mean = z_score(ratio[:, None] * estimate[:, -1], mean[-1])
    worst = max(z_score(ratio, 1), *of_mean)
    assert worst < LIMIT if is_right else worst > WRONG


def test_a_state_of_whole_numbers_is_one_of_floats():
    """Counts, such as of animals, are drawn whole."""
    its = space(
        initial=lambda key, p: jax.random.randint(key, (), 0, 7),
        transition=lambda key, x, p: x + jax.random.randint(key, (), 0, 3),
    )
    state = its.init(KEY)
    assert state.substates.dtype == np.float32
    assert set(np.ravel(state.substates)) <= set(range(7))
    after, _ = its.step(KEY, state, FRAMES[0])
    assert set(np.ravel(after.substates - after.previous_substates)) == {0, 1, 2}


@pytest.mark.parametrize("first", [0, 0.0, np.zeros(())])
def test_a_known_state_is_as_precise_as_the_run(first):
    its = space(initial=first)
    for wide, dtype in ((True, np.float64), (False, np.float32)):
        with jax.enable_x64(wide):
            summary = jax.eval_shape(lambda: jaxpf.run(its, KEY, FRAMES)[1])
        assert summary.estimate.dtype == dtype


def test_the_activations_of_a_network_are_static():
    equinox = pytest.importorskip("equinox")
    net = equinox.nn.MLP(1, 1, 1, 1, activation=jnp.tanh, key=KEY)
    parts = jax.tree.leaves(space(parameters=net, initial=0.0, transition=lambda key, x, p: x))
    assert {id(weight) for weight in jax.tree.leaves(equinox.filter(net, equinox.is_array))} <= {
        *map(id, parts)
    }
    assert not any(map(callable, parts))


@pytest.mark.slow
@pytest.mark.always
def test_the_weights_of_a_network_have_derivatives():
    """A perceptron of one layer of a tanh, against the same function of numbers."""
    equinox = pytest.importorskip("equinox")
    net = equinox.nn.MLP(1, 1, 1, 1, activation=jnp.tanh, key=KEY)

    def by_net(key, x, p):
        return p(x[None])[0] + jax.random.normal(key)

    def by_numbers(key, x, p):
        first, second = p
        return jnp.tanh(first[0] * x + first[1]) * second[0] + second[1] + jax.random.normal(key)

    numbers = [(layer.weight[0, 0], layer.bias[0]) for layer in net.layers]
    models = (
        space(
            parameters=p,
            initial=0.0,
            transition=move,
            log_likelihood=lambda y, x, p: norm.logpdf(y, x),
        )
        for p, move in ((net, by_net), (numbers, by_numbers))
    )

    def evidence(its):
        return jnp.sum(jaxpf.run(its, KEY, FRAMES)[1].log_evidence)

    (one, slopes), (other, expected) = (
        jax.jit(jax.value_and_grad(evidence))(its) for its in models
    )
    np.testing.assert_allclose(one, other, rtol=1e-5)
    found = [(x.weight[0, 0], x.bias[0]) for x in slopes.dynamics.parameters.layers]
    np.testing.assert_allclose(found, expected.dynamics.parameters, rtol=1e-4)


# Parameters are traced


def test_a_derivative_in_the_tracker_is_whole():
    """The parameters of the initial state, the motion and the likelihood are one."""

    def evidence(its):
        return jnp.sum(jaxpf.run(its, KEY, FRAMES)[1].log_evidence)

    of_tracker = jax.jit(jax.grad(evidence))(space())
    of_values = jax.jit(jax.grad(lambda values: evidence(space(parameters=values))))(VALUES)
    for part in (of_tracker.initial, of_tracker.dynamics, of_tracker.likelihood):
        for name, slope in of_values.items():
            np.testing.assert_allclose(part.parameters[name], slope, rtol=1e-5)


def test_other_parameters_compile_nothing_new():
    jaxpf.run(space(), KEY, FRAMES)
    programs = run_compiled._cache_size()
    jaxpf.run(space(parameters={"a": 0.1, "s": 2.0, "noise": 1.0}), KEY, FRAMES)
    assert run_compiled._cache_size() == programs
    jaxpf.run(space(log_likelihood=lambda *x: log_likelihood(*x)), KEY, FRAMES)
    assert run_compiled._cache_size() == programs + 1


def log_evidence(values, **options):
    return jnp.sum(jaxpf.run(space(parameters=values, **options), KEY, FRAMES)[1].log_evidence)


@pytest.mark.slow
def test_a_gradient_goes_through_all_functions():
    """With one particle there is no resampling: finite differences are exact but for rounding."""
    with jax.enable_x64(True):
        gradient = jax.jit(jax.grad(lambda values: log_evidence(values, num_particles=1)))(VALUES)
        for name, value in VALUES.items():
            ends = [
                float(log_evidence(VALUES | {name: value + step}, num_particles=1))
                for step in (-1e-5, 1e-5)
            ]
            np.testing.assert_allclose(gradient[name], (ends[1] - ends[0]) / 2e-5, rtol=1e-6)


def test_tuning_names_a_parameter_once_and_changes_it_everywhere():
    tracker = space()
    assert names(tracker) == ["parameters.a", "parameters.noise", "parameters.s"]
    changed = jaxpf.tuning.replace(tracker, {"parameters.s": 2.0})
    parts = changed.dynamics, changed.likelihood, changed.initial
    assert [part.parameters["s"] for part in parts] == [2.0, 2.0, 2.0]


@pytest.mark.parametrize(
    "smooth",
    [
        lambda its: jaxpf.smooth(its, KEY, FRAMES, lag=2),
        lambda its: jaxpf.smoothing.particle_gibbs(its, KEY, FRAMES, 2),
    ],
)
def test_a_likelihood_that_sees_the_state_before_is_not_smoothed_with_a_lag(smooth):
    assert "use jaxpf.smooth" in message_of(smooth, sees_both(resampling="multinomial"))


def test_a_frame_may_be_drawn_by_the_state_before_without_a_likelihood_that_sees_it():
    its = jaxpf.state_space(
        initial=1.0,
        transition=lambda key, x, p: x + 1.0,
        log_likelihood=lambda y, x, p: jax.scipy.stats.norm.logpdf(y, x),
        observation=lambda key, x, p, previous: x - previous,
    )
    _, frames = jaxpf.simulate(its, jax.random.key(0), 3)
    np.testing.assert_array_equal(np.ravel(frames), [1, 1, 1])
