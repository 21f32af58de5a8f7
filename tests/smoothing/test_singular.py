"""Motions without noise in some direction: their densities are refused, and no others."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.scipy.stats import norm
from models import partitioned
from refusals import message_of

import jaxpf
from jaxpf.dynamics import RandomWalk
from jaxpf.smoothing.checks import check_smoothing

draw = jax.random.normal


def model(initial, transition, density):
    return jaxpf.state_space(
        initial=initial,
        transition=transition,
        transition_log_density=density,
        log_likelihood=lambda y, x, p: norm.logpdf(y, x[0]),
    )


def late(key, x, p):
    """Constant velocity: the position follows the velocity before."""
    return jnp.stack([x[0] + x[1], x[1] + 0.5 * draw(key)])


def accelerated(key, x, p):
    """Constant velocity, and an acceleration that moves both."""
    push = 0.5 * draw(key)
    return jnp.stack([x[0] + x[1] + push / 2, x[1] + push])


def turning(key, x, p):
    heading = x[2] + 0.3 * draw(key)
    return jnp.stack([x[0] + jnp.cos(heading), x[1] + jnp.sin(heading), heading])


def of_push(new, x, p):
    push = (2 * (new[0] - x[0] - x[1]) + new[1] - x[1]) / 2
    return norm.logpdf(push, 0, 0.5)


def switching(key, x, p):
    stays, moves = jax.random.split(key)
    regime = jnp.where(jax.random.uniform(stays) < 0.001, 1 - x[1], x[1])
    return jnp.stack([x[0] + draw(moves), regime])


def of_switch(new, x, p):
    return norm.logpdf(new[0], x[0]) + jnp.where(new[1] == x[1], np.log(0.999), np.log(0.001))


SINGULAR = {
    "late": (jnp.zeros(2), late, lambda new, x, p: norm.logpdf(new[1], x[1], 0.5)),
    "accelerated": (
        lambda key, p: 10 * draw(key, (2,)),
        accelerated,
        lambda new, x, p: norm.logpdf(new[1], x[1], 0.5),
    ),
    "accelerated, both": (lambda key, p: 10 * draw(key, (2,)), accelerated, of_push),
    "turning": (jnp.zeros(3), turning, lambda new, x, p: norm.logpdf(new[2], x[2], 0.3)),
    "constant": (
        lambda key, p: draw(key, (2,)),
        lambda key, x, p: jnp.stack([x[0] + x[1] + draw(key), x[1]]),
        lambda new, x, p: norm.logpdf(new[0], x[0] + x[1]),
    ),
}
PROPER = {
    "one value": (
        jnp.array([0.0, 0.3]),
        lambda key, x, p: jnp.stack([x[0] + x[1] + draw(key), x[1]]),
        lambda new, x, p: norm.logpdf(new[0], x[0] + x[1]),
    ),
    "a little noise": (
        jnp.array([1000.0, 0.0]),
        lambda key, x, p: accelerated(key, x, p) + 1e-4 * draw(jax.random.fold_in(key, 1), (2,)),
        lambda new, x, p: jax.scipy.stats.multivariate_normal.logpdf(
            new,
            jnp.stack([x[0] + x[1], x[1]]),
            0.25 * jnp.array([[0.25, 0.5], [0.5, 1]]) + 1e-8 * jnp.eye(2),
        ),
    ),
    "rarely changed": (
        lambda key, p: jnp.stack([0.0, 1.0 * jax.random.bernoulli(key)]),
        switching,
        of_switch,
    ),
    "placed by the angle": (
        jnp.zeros(2),
        lambda key, x, p: (lambda angle: jnp.stack([jnp.sin(angle), angle]))(x[1] + draw(key)),
        lambda new, x, p: norm.logpdf(new[1], x[1]),
    ),
    "uniform": (
        jnp.zeros(2),
        lambda key, x, p: x.at[0].add(draw(key)).at[1].set(jax.random.uniform(key)),
        lambda new, x, p: norm.logpdf(new[0], x[0]),
    ),
}


@pytest.mark.parametrize("case", SINGULAR)
def test_a_density_that_leaves_out_a_direction_is_refused(case):
    its = model(*SINGULAR[case])
    assert 'method="genealogy"' in message_of(jaxpf.smooth, its, jax.random.key(0), np.zeros(4))


@pytest.mark.parametrize(
    "case", [pytest.param(x, marks=[pytest.mark.slow] * (x == "a little noise")) for x in PROPER]
)
def test_a_density_of_all_that_differs_is_accepted(case):
    check_smoothing(model(*PROPER[case]))


def test_the_partition_is_named():
    noise = np.float32([[1, 1], [1, 0]])
    start = jax.tree_util.Partial(lambda key: draw(key, (2, 2)))
    its = partitioned(dimension=2, dynamics=RandomWalk(noise), initial=start)
    assert "partitions [1]" in message_of(check_smoothing, its)
