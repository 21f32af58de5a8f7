"""Ways to select that keep a gradient: lent gradients, soft resampling, transport."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from fenced_trackers import (
    KEYS,
    METHODS,
    Fenced,
    P,
    frames,
    tracker,
    value_and_gradient,
)

import jaxpf
from jaxpf import ordering, resampling
from jaxpf.dynamics import RandomWalk
from jaxpf.gradients import Soft, Transport
from jaxpf.lowering.derivatives import with_gradient_of
from jaxpf.resampling.components import one_component
from jaxpf.resampling.weighted import keep_total, soft_selection


def test_the_gradient_of_a_source_is_lent_and_its_value_is_not():
    lent = jax.jit(jax.value_and_grad(lambda x: with_gradient_of(3.0 * x, jnp.log(x - 2.0))))
    assert lent(4.0) == (12.0, 3.5)
    assert with_gradient_of(1.0, -jnp.inf) == 1.0


@pytest.mark.parametrize("scheme", resampling.SCHEMES)
def test_soft_resampling_is_properly_weighted_and_keeps_a_gradient(scheme):
    weights = np.float32([0.1, 2.0, 0.0, 0.4])
    values = np.float32([1.0, 2.0, 3.0, -4.0])
    keys = jax.random.split(jax.random.key(0), 4000)

    @jax.value_and_grad
    def mean(log_weights, key):
        whole = one_component(4)
        selection = soft_selection(log_weights, 0.4, whole)
        chosen, new = resampling.weighted_resample(key, log_weights, selection, scheme, whole)
        new = keep_total(new, log_weights, whole)
        return jnp.sum(jnp.exp(new) * jnp.asarray(values)[chosen])

    means = jax.jit(lambda w, keys: jax.vmap(mean, in_axes=(None, 0))(jnp.log(w), keys))
    value, slope = jax.device_get(means(weights, keys))
    expected = np.sum(weights * values)
    assert abs(value.mean() - expected) < 4.5 * value.std() / len(keys) ** 0.5
    assert np.isfinite(slope).all()
    assert (np.abs(slope.mean(0)) > 0.01).tolist() == [True, True, False, True]


def test_soft_selection_leaves_a_dead_component_dead():
    @jax.jit
    def mix(weights):
        components = resampling.components_of_sizes(jnp.array([2, 2]), 4)
        return soft_selection(jnp.log(weights), 0.5, components)

    mixed = np.asarray(mix(np.float32([1.0, 3.0, 0, 0])))
    np.testing.assert_allclose(np.exp(mixed[:2]), [0.75, 1.25], rtol=1e-6)
    assert np.isneginf(mixed[2:]).all()


@pytest.mark.slow
def test_transport_blends_to_equal_weights_and_keeps_the_mean():
    pytest.importorskip("ott", reason="needs jaxpf[transport]")
    lagged = jax.random.normal(jax.random.key(0), (2, 1, P, 6))
    log_weights = jnp.log(jnp.array([0.1, 0.2, 0.3, 0.5, 0.0, 0.7]))
    components = resampling.components_of_sizes(jnp.array([3, 3]), 6)
    blended, new, done = Transport().blend(lagged, log_weights, components)
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
            gradient=Transport(),
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
    made = tracker(ordering.ps([0]), gradient=Transport(), num_particles=32)
    seen = np.cumsum(np.random.default_rng(1).normal(size=(8, 1, 2)), axis=0)
    seen[..., 1] = np.inf
    value, slope = value_and_gradient(made, jax.random.split(jax.random.key(3), 300), seen)
    assert value.dtype == np.float32
    assert np.isfinite(value).all()
    assert np.isfinite(slope).all()


@pytest.mark.parametrize(
    "scheme", ["systematic", pytest.param("multinomial", marks=pytest.mark.slow)]
)
def test_soft_resampling_leaves_out_every_exchange(scheme):
    """Its weights stay unequal, slot by slot, and no exchange may renumber the slots."""
    tree = (-1, 0, 0)
    soft = partial(tracker, gradient=Soft(), resampling=scheme, parents=tree)
    run = jax.jit(jaxpf.run)
    expected, *others = (
        run(soft(ordering.sps(tree, swap)), jax.random.key(3), frames(np.inf, 3))
        for swap in ("none", "combinatorial", "sorted")
    )
    for found in others:
        jax.tree.map(np.testing.assert_array_equal, found, expected)
