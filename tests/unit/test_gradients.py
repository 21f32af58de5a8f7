"""Gradients through resampling: forward pass, finiteness, the score of the motion, refusals.

Their expectation is checked in ``tests/statistical/test_unbiased_gradients.py``.
"""

import dataclasses
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.stats

import jaxpf
from jaxpf import InputError
from jaxpf.filters import resampling
from jaxpf.filters.partitioned import gradients, ordering
from jaxpf.models.dynamics import AR2, LinearGaussian, RandomWalk
from jaxpf.models.likelihoods.gaussian import CorrelatedGaussian, Gaussian
from jaxpf.pytree import pytree_dataclass
from jaxpf.tuning import objectives

P, T = 2, 3
#: Halves the time to compile; the arithmetic is the same.
quick = partial(jax.jit, compiler_options={"xla_llvm_disable_expensive_passes": True})


@pytree_dataclass
class Fenced:
    """Normal around the frame's first number, impossible beyond its second."""

    noise: jax.Array

    def observe(self, frame):
        return frame

    def log_prob(self, observation, partition, substate):
        y, fence = observation[partition]
        value = -0.5 * ((y - substate[0]) / self.noise) ** 2 - jnp.log(self.noise)
        return jnp.where(substate[0] > fence, -jnp.inf, value)


def tracker(order, **settings):
    defaults = {
        "dynamics": RandomWalk(scale=jnp.float32(1.0)),
        "likelihood": Fenced(noise=jnp.float32(0.7)),
        "initial": np.zeros((order.num_partitions, 1), np.float32),
        "num_particles": 12,
    }
    return jaxpf.Partitioned(ordering=order, **(defaults | settings))


def frames(fences, num_partitions=P):
    """``[T, P, 2]``: observations of all partitions, and each frame's fences ``[P]``."""
    made = np.zeros((T, num_partitions, 2), np.float32)
    made[..., 0] = np.random.default_rng(0).normal(size=made.shape[:2])
    made[..., 1] = fences
    return made


METHODS = {
    "sir": ordering.sir(P),
    "ps": ordering.ps([1, 0]),
    "dps": ordering.dps(P),
    "literal": ordering.dps(P, reassembly="literal"),
    "sps": ordering.sps(num_partitions=P),
    "random": ordering.sps(num_partitions=P, swap="random"),
}
FENCES = {
    "possible": np.full((T, P), np.inf),
    "some particles": np.full((T, P), 0.3),
    "all particles": np.where(np.arange(T)[:, None] == 1, -np.inf, [np.inf] * P),
    "one partition": np.where(np.arange(T)[:, None] == 1, [-np.inf, np.inf], [np.inf] * P),
}


@quick
def value_and_gradient(made, keys, seen):
    def mean_of_possible(scale, noise):
        changed = dataclasses.replace(
            made,
            dynamics=dataclasses.replace(made.dynamics, scale=scale),
            likelihood=dataclasses.replace(made.likelihood, noise=noise),
        )
        value = objectives.log_evidence(changed, keys, seen, checkpoint=False)
        return jnp.mean(jnp.where(jnp.isneginf(value), 0.0, value)), value

    one = jax.value_and_grad(mean_of_possible, argnums=(0, 1), has_aux=True)
    (_, value), gradient = one(made.dynamics.scale, made.likelihood.noise)
    return value, jnp.stack(gradient)


KEYS = jax.random.split(jax.random.key(0), 6)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("gradient", "methods"),
    [("stop_gradient", list(METHODS)), ("soft", ["dps", "literal"])],
)
def test_gradients_are_finite_whatever_becomes_impossible(gradient, methods):
    for name, fences in FENCES.items():
        for method in methods:
            made = tracker(METHODS[method], gradient=gradient)
            value, slope = value_and_gradient(made, KEYS, frames(fences))
            assert np.isfinite(slope).all(), name
            assert np.isneginf(value).all() == (name in ("all particles", "one partition")), name
            if name == "possible":
                assert (np.abs(slope) > 1e-3).all()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("gradient", "num_particles"),
    [("none", 1), ("stop_gradient", 1), ("soft", 1), ("transport", 1), ("transport", 12)],
)
def test_gradients_are_finite_with_one_partition_and_few_particles(gradient, num_particles):
    if gradient == "transport":
        pytest.importorskip("ott", reason="needs jaxpf[transport]")
    for fences in FENCES.values():
        made = tracker(ordering.ps([0]), gradient=gradient, num_particles=num_particles)
        _, slope = value_and_gradient(made, KEYS[:2], frames(fences[:, :1], 1))
        assert np.isfinite(slope).all()


@pytest.mark.slow
def test_stop_gradient_leaves_the_forward_pass_as_it_is_bit_for_bit():
    seen = frames(FENCES["some particles"])
    for name in ("ps", "sps", "random"):  # of one shape: they share what is compiled
        for fenced in (seen, frames(FENCES["possible"])):
            kept = [
                jax.device_get(jaxpf.run(tracker(METHODS[name], gradient=mode), KEYS[0], fenced))
                for mode in ("none", "stop_gradient")
            ]
            (state, summaries), (other, others) = kept
            assert not np.any(other.scores)
            assert_equal(
                (state, summaries), (dataclasses.replace(other, scores=None), others), name
            )


def assert_equal(one, other, name):
    for a, b in zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True):
        np.testing.assert_array_equal(a, b, err_msg=name)


# The score of the motion.


@pytree_dataclass
class WholePixels:
    """Likelihood of the whole number next to the substate: what a box of pixels sees."""

    noise: jax.Array

    state_gradient = False

    def observe(self, frame):
        return frame

    def log_prob(self, observation, partition, substate):
        return -0.5 * ((observation[0, 0] - jnp.round(substate[0])) / self.noise) ** 2


@quick
def mean_evidence(made, scale, keys, seen):
    """Mean evidence over runs, and per run its gradient in the scale."""

    def log_evidence(scale, key):
        changed = dataclasses.replace(made, dynamics=RandomWalk(scale=scale))
        return objectives.log_evidence(changed, key[None], seen, checkpoint=False)[0]

    value, slope = jax.vmap(jax.value_and_grad(log_evidence), in_axes=(None, 0))(scale, keys)
    return jnp.exp(value), jnp.exp(value) * slope


@pytest.mark.slow
def test_score_of_the_motion_finds_the_slope_that_whole_pixels_hide():
    seen = np.float32([[[2.0]], [[3.0]], [[5.0]]])
    keys = jax.random.split(jax.random.key(1), 4000)
    made = tracker(
        ordering.ps([0]),
        likelihood=WholePixels(noise=np.float32(1.5)),
        gradient="stop_gradient",
        num_particles=50,
    )
    step = 0.1
    ends = [mean_evidence(made, 1.5 + sign * step, keys, seen)[0] for sign in (1, -1)]
    differences = np.asarray(ends[0] - ends[1]) / (2 * step)
    expected, its_error = differences.mean(), differences.std() / len(keys) ** 0.5
    assert expected > 20 * its_error
    _, pathwise = mean_evidence(made, 1.5, keys, seen)
    np.testing.assert_array_equal(pathwise, 0.0)  # silently wrong
    _, score = mean_evidence(dataclasses.replace(made, motion_gradient="score"), 1.5, keys, seen)
    score = np.asarray(score)
    error = np.hypot(its_error, score.std() / len(keys) ** 0.5)
    assert abs(score.mean() - expected) < 4.5 * error
    assert score.mean() > 10 * error  # the test could tell it from zero


def test_log_densities_are_those_of_the_draws():
    new, current, previous, parent = np.random.default_rng(0).normal(size=(4, 2))
    partition = jnp.array(1)
    scale = np.array([[1.0, 2.0], [0.5, 3.0]])
    arguments = partition, *map(jnp.asarray, (new, current, previous, parent))
    walk = RandomWalk(scale=scale).log_density(*arguments)
    expected = scipy.stats.norm.logpdf(new, current, scale[1]).sum()
    np.testing.assert_allclose(walk, expected, rtol=1e-5)
    second = AR2(scale=scale[1], momentum=0.3).log_density(*arguments)
    drift = current + 0.3 * (current - previous)
    np.testing.assert_allclose(
        second, scipy.stats.norm.logpdf(new, drift, scale[1]).sum(), rtol=1e-5
    )
    blocks = np.random.default_rng(1).normal(size=(4, 2, 2, 2))
    general = LinearGaussian(
        transition=blocks[0], noise=blocks[1], lag=blocks[2], coupling=blocks[3],
        offset=np.ones((2, 2)),
    )  # fmt: skip
    a, root, b, c = blocks[:, 1]
    mean = a @ current + b @ previous + c @ parent + 1.0
    expected = scipy.stats.multivariate_normal.logpdf(new, mean, root @ root.T)
    np.testing.assert_allclose(general.log_density(*arguments), expected, rtol=1e-4)


def test_a_dimension_without_noise_is_left_out_of_the_density():
    walk = RandomWalk(scale=jnp.array([0.5, 0.0]))
    zero = jnp.zeros(2)

    def density(scale):
        return RandomWalk(scale=scale).log_density(0, jnp.array([1.0, 7.0]), zero, zero, zero)

    value, slope = jax.value_and_grad(density)(walk.scale)
    np.testing.assert_allclose(value, scipy.stats.norm.logpdf(1.0, 0.0, 0.5), rtol=1e-6)
    assert np.isfinite(slope).all()


# The parts.


def test_the_gradient_of_a_source_is_lent_and_its_value_is_not():
    lent = jax.value_and_grad(lambda x: gradients.with_gradient_of(3.0 * x, jnp.log(x - 2.0)))
    assert lent(4.0) == (12.0, 3.5)
    assert gradients.with_gradient_of(1.0, -jnp.inf) == 1.0


@pytest.mark.parametrize("scheme", resampling.SCHEMES)
def test_soft_resampling_is_properly_weighted_and_keeps_a_gradient(scheme):
    log_weights = jnp.log(jnp.array([0.1, 2.0, 0.0, 0.4]))
    whole = resampling.one_component(4)
    values = jnp.array([1.0, 2.0, 3.0, -4.0])

    def mean(log_weights, key):
        selection = resampling.soft_selection(log_weights, 0.4, whole)
        chosen, new = resampling.weighted_resample(key, log_weights, selection, scheme, whole)
        new = resampling.keep_total(new, log_weights, whole)
        return jnp.sum(jnp.exp(new) * values[chosen])

    keys = jax.random.split(jax.random.key(0), 4000)
    value, slope = jax.vmap(jax.value_and_grad(mean), in_axes=(None, 0))(log_weights, keys)
    expected = np.sum(np.exp(log_weights) * values)
    assert abs(value.mean() - expected) < 4.5 * value.std() / len(keys) ** 0.5
    assert np.isfinite(slope).all()
    assert (np.abs(slope.mean(0)) > 0.01).tolist() == [True, True, False, True]


def test_soft_selection_leaves_a_dead_component_dead():
    components = resampling.components_of_sizes(jnp.array([2, 2]), 4)
    mixed = resampling.soft_selection(jnp.log(jnp.array([1.0, 3.0, 0, 0])), 0.5, components)
    np.testing.assert_allclose(jnp.exp(mixed[:2]), [0.75, 1.25], rtol=1e-6)
    assert np.isneginf(mixed[2:]).all()


def test_transport_blends_to_equal_weights_and_keeps_the_mean():
    pytest.importorskip("ott", reason="needs jaxpf[transport]")
    from jaxpf.filters.partitioned import transport

    made = tracker(ordering.dps(P), gradient="transport", num_particles=6)
    lagged = jax.random.normal(jax.random.key(0), (2, 1, P, 6))
    log_weights = jnp.log(jnp.array([0.1, 0.2, 0.3, 0.5, 0.0, 0.7]))
    components = resampling.components_of_sizes(jnp.array([3, 3]), 6)
    blended, new, done = transport.blend(made, lagged, log_weights, components)
    assert done
    np.testing.assert_allclose(jnp.exp(new), [0.2] * 3 + [0.4] * 3, rtol=1e-5)
    for part in (slice(0, 3), slice(3, 6)):
        share = jnp.exp(log_weights[part]) / jnp.exp(log_weights[part]).sum()
        np.testing.assert_allclose(
            blended[..., part].mean(-1), lagged[..., part] @ share, atol=0.02
        )


@pytest.mark.slow
def test_transport_has_the_derivative_of_its_own_value():
    """Nothing is drawn but noise: with common keys the evidence is a smooth function."""
    pytest.importorskip("ott", reason="needs jaxpf[transport]")

    def at(method, scale, noise):
        made = tracker(
            METHODS[method],
            gradient="transport",
            dynamics=RandomWalk(scale=jnp.asarray(scale)),
            likelihood=Fenced(noise=jnp.asarray(noise)),
            initial=np.zeros((P, 1)),
        )
        value, slope = value_and_gradient(made, KEYS[:2], frames(np.inf))
        return float(jnp.mean(value)), slope

    step = 1e-4
    with jax.enable_x64(True):
        for method in ("sir", "ps", "dps"):
            differences = [
                at(method, 1 + i * step, 0.7 + j * step)[0]
                - at(method, 1 - i * step, 0.7 - j * step)[0]
                for i, j in ((1, 0), (0, 1))
            ]
            # Sinkhorn stops at a marginal error of 1e-3; its derivative is that of the limit.
            np.testing.assert_allclose(
                at(method, 1.0, 0.7)[1], np.array(differences) / (2 * step), rtol=0.02
            )


@pytest.mark.slow
def test_transport_has_finite_gradients_in_float32_over_many_runs():
    """Clusters that hardly exchange mass make the potentials' system nearly singular."""
    pytest.importorskip("ott", reason="needs jaxpf[transport]")
    made = tracker(ordering.ps([0]), gradient="transport", num_particles=32)
    seen = np.cumsum(np.random.default_rng(1).normal(size=(8, 1, 2)), axis=0)
    seen[..., 1] = np.inf
    value, slope = value_and_gradient(made, jax.random.split(jax.random.key(3), 300), seen)
    assert value.dtype == np.float32
    assert np.isfinite(value).all()
    assert np.isfinite(slope).all()


# Refusals.


@pytree_dataclass
class Unknown:
    """A motion without a density."""

    scale: jax.Array

    def propagate(self, key, partition, current, previous, parent):
        return current


@pytest.mark.parametrize(
    ("settings", "what"),
    [
        ({"gradient": "exact"}, "gradient='exact' is unknown; choose one of none, stop_gradient"),
        ({"motion_gradient": "both"}, "motion_gradient='both' is unknown"),
        (
            {"dynamics": Unknown(jnp.ones(())), "motion_gradient": "score"},
            "needs the method log_density of the dynamics, and Unknown has none",
        ),
        ({"gradient": "transport"}, "does not go with a swap, which needs lineages"),
        (
            {"gradient": "transport", "ordering": ordering.dps(P), "tempering": 0.5},
            "does not go with tempering",
        ),
        (
            {
                "gradient": "transport",
                "ordering": ordering.dps(P),
                "likelihood": CorrelatedGaussian(jnp.eye(P)),
            },
            "does not go with log_joint",
        ),
        ({"gradient": "transport", "ordering": ordering.branched([[0, 1]])}, "labels"),
        (
            {"gradient": "transport", "ordering": ordering.sir(P), "transport_epsilon": 0.0},
            "transport_epsilon=0.0 must be above 0",
        ),
        ({"gradient": "soft", "soft_share": 1.5}, "soft_share=1.5 must be above 0 and at most 1"),
    ],
)
def test_what_cannot_work_is_refused_in_one_sentence(settings, what):
    order = settings.pop("ordering", ordering.sps(num_partitions=P))
    with pytest.raises(InputError, match=what):
        tracker(order, **settings)


def test_a_motion_gradient_that_would_be_zero_is_refused():
    made = tracker(ordering.ps([0]), likelihood=WholePixels(noise=np.float32(1.0)))
    with pytest.raises(InputError, match=r"WholePixels .*motion_gradient='score'"):
        gradients.check_motion_gradient(made)
    gradients.check_motion_gradient(dataclasses.replace(made, motion_gradient="score"))
    gradients.check_motion_gradient(tracker(ordering.ps([0])))
    gradients.check_motion_gradient(
        tracker(ordering.ps([0]), likelihood=Gaussian(noise=np.ones((1, 1, 1))))
    )


@pytest.mark.parametrize("scheme", ["systematic", "multinomial"])
def test_soft_resampling_leaves_out_every_exchange(scheme):
    """Its weights stay unequal, slot by slot, and no exchange may renumber the slots."""
    tree = (-1, 0, 0)
    soft = partial(tracker, gradient="soft", resampling=scheme, parents=tree)
    run = quick(jaxpf.run)
    expected, *others = (
        run(soft(ordering.sps(tree, swap)), jax.random.key(3), frames(np.inf, 3))
        for swap in ("none", "combinatorial", "sorted")
    )
    for found in others:
        jax.tree.map(np.testing.assert_array_equal, found, expected)
