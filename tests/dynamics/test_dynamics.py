"""Dynamics: the formulas, noise aside and noise included, for one particle and for all."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import multivariate_normal, norm

from jaxpf.dynamics import AR2, IndependentGaussian, LinearGaussian, RandomWalk

N = 20_000
KEY = jax.random.key(0)
#: Of one particle: its substate, the one before, and its parent's.
PAST = np.array([[1.0, -2.0], [0.5, 3.0], [-1.0, 2.0]])


def particles(values):
    """``[D, N]``: the same substate in every particle."""
    return jnp.repeat(jnp.asarray(values, jnp.float32)[:, None], N, axis=1)


def move(dynamics, partition, current=(0.0, 0.0), previous=(0.0, 0.0), parent=(0.0, 0.0)):
    partitions = jnp.full((N,), partition)
    return np.asarray(
        dynamics.propagate_all(KEY, partitions, *map(particles, (current, previous, parent)))
    )


def assert_normal(samples, mean, covariance):
    """Mean and covariance within 4.5 standard errors, of samples ``[D, N]``."""
    covariance = np.asarray(covariance, float)
    error = np.sqrt(np.diagonal(covariance) / N)
    assert (np.abs(samples.mean(1) - mean) <= 4.5 * error + 1e-5).all()
    scale = np.sqrt(np.outer(np.diagonal(covariance), np.diagonal(covariance)) + covariance**2)
    assert (np.abs(np.cov(samples) - covariance) <= 4.5 * scale / N**0.5 + 1e-5).all()


@pytest.mark.parametrize(
    ("scale", "expected"),
    [
        (np.float32(2.0), (2.0, 2.0)),
        (np.array([1.0, 3.0]), (1.0, 3.0)),
        (np.array([[1.0, 3.0], [0.5, 4.0]]), (0.5, 4.0)),
    ],
    ids=["scalar", "by-dimension", "by-partition"],
)
def test_random_walk_adds_noise_of_the_given_scale(scale, expected):
    moved = move(RandomWalk(scale), 1, current=(5.0, -1.0), previous=(99.0, 99.0))
    assert_normal(moved, (5.0, -1.0), np.diag(np.square(expected)))


def test_ar2_repeats_half_the_last_displacement():
    moved = move(AR2(np.array([2.0, 0.5])), 0, current=(5.0, -1.0), previous=(3.0, 1.0))
    assert_normal(moved, (6.0, -2.0), np.diag([4.0, 0.25]))


def test_ar2_momentum_is_a_parameter():
    moved = move(AR2(np.float32(0.0), momentum=2.0), 0, current=(5.0, 0.0), previous=(3.0, 0.0))
    np.testing.assert_allclose(moved[0], 9.0)


def linear():
    rng = np.random.default_rng(1)
    return LinearGaussian(
        transition=rng.normal(size=(3, 2, 2)),
        noise=np.tril(rng.normal(size=(3, 2, 2))),
        lag=rng.normal(size=(3, 2, 2)),
        coupling=rng.normal(size=(3, 2, 2)),
        offset=rng.normal(size=(3, 2)),
    )


@pytest.mark.parametrize("partition", [0, 2])
def test_linear_gaussian_uses_every_term_of_its_partition(partition):
    made, p = linear(), partition
    current, previous, parent = PAST
    moved = move(made, p, *PAST)
    mean = (
        made.transition[p] @ current
        + made.lag[p] @ previous
        + made.coupling[p] @ parent
        + made.offset[p]
    )
    assert_normal(moved, mean, made.noise[p] @ made.noise[p].T)


@pytest.mark.parametrize(
    ("made", "root"),
    [
        (RandomWalk(np.array([[1.0, 3.0], [0.5, 4.0]])), np.diag([0.5, 4.0])),
        (AR2(np.array([2.0, 0.5]), momentum=0.7), np.diag([2.0, 0.5])),
        (linear(), linear().noise[1]),
    ],
)
def test_the_density_is_that_of_the_draws(made, root):
    """Of SciPy's normal around the move without noise."""
    names = {"noise"} & made.__dataclass_fields__.keys() or {"scale"}
    still = dataclasses.replace(made, **{name: 0 * getattr(made, name) for name in names})
    mean = still.propagate(KEY, 1, *map(jnp.asarray, PAST))
    new = np.asarray(mean) + np.random.default_rng(2).normal(size=(5, 2)) @ root.T
    past = [jnp.repeat(jnp.asarray(x)[:, None], 5, axis=1) for x in PAST]
    found = made.log_density_all(jnp.ones(5, jnp.int32), jnp.asarray(new.T), *past)
    expected = multivariate_normal.logpdf(new, mean, root @ root.T)
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-4)
    of_one = made.log_density(jnp.array(1), *map(jnp.asarray, (new[0], *PAST)))
    np.testing.assert_allclose(of_one, expected[0], rtol=1e-4, atol=1e-4)


def test_a_coordinate_without_noise_has_no_part_in_the_density():
    new, past = jnp.array([[3.0], [1.0]]), jnp.zeros((2, 1))
    partition = jnp.zeros(1, jnp.int32)

    @jax.value_and_grad
    def density(scale):
        return RandomWalk(scale).log_density_all(partition, new, past, past, past)[0]

    found, slope = density(jnp.array([2.0, 0.0]))
    np.testing.assert_allclose(found, norm.logpdf(3.0, 0.0, 2.0), rtol=1e-5)
    assert np.isfinite(slope).all()


def test_partitions_may_differ_from_particle_to_particle():
    made = LinearGaussian(
        transition=np.array([[[1.0]], [[2.0]]]), noise=np.zeros((2, 1, 1)), offset=[[0.0], [10.0]]
    )
    ones = jnp.ones((1, 4))
    moved = made.propagate_all(KEY, jnp.array([0, 1, 1, 0]), ones, ones, ones)
    np.testing.assert_array_equal(moved, [[1.0, 12.0, 12.0, 1.0]])


@pytest.mark.parametrize("make", [linear, lambda: RandomWalk(1.0), lambda: AR2(1.0)])
def test_one_particle_form_has_the_law_of_the_batched_one(make):
    made = make()
    keys, past = jax.random.split(jax.random.key(1), N), jnp.asarray(PAST)
    one = jax.vmap(lambda key: made.propagate(key, 1, *past))(keys)
    assert one.shape == (N, 2)
    one, together = np.asarray(one, float).T, move(made, 1, *PAST)
    # Both are estimates: the difference has twice the variance of either.
    spread = np.cov(together)
    error = np.sqrt(2 * np.diagonal(spread) / N)
    assert (np.abs(one.mean(1) - together.mean(1)) < 4.5 * error).all()
    scale = np.sqrt(np.outer(np.diagonal(spread), np.diagonal(spread)) + spread**2)
    assert (np.abs(np.cov(one) - spread) < 4.5 * scale * np.sqrt(2 / N)).all()


@pytest.mark.parametrize("make", [linear, lambda: RandomWalk(1.0), lambda: AR2(1.0)])
def test_dtype_is_that_of_the_substates(make):
    with jax.enable_x64(True):
        for dtype in (jnp.float32, jnp.float64):
            x = jnp.zeros((2, 5), dtype)
            given = KEY, jnp.zeros(5, jnp.int32), x, x, x
            moved = jax.eval_shape(make().propagate_all, *given)
            assert moved.dtype == dtype


def test_independent_gaussian_draws_every_partition_on_its_own():
    sampler = IndependentGaussian(
        mean=np.array([[1.0, 2.0], [3.0, 4.0]], np.float32), scale=np.array([0.5, 2.0])
    )
    drawn = jax.vmap(sampler)(jax.random.split(KEY, N))
    assert drawn.shape == (N, 2, 2)
    assert_normal(
        np.asarray(drawn, np.float64).reshape(N, 4).T,
        [1.0, 2.0, 3.0, 4.0],
        np.diag([0.25, 4.0, 0.25, 4.0]),
    )
    assert sampler.independent
