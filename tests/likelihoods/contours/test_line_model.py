"""The line model: a density, equal to brute force, exclusive, with finite derivatives."""

from itertools import combinations, permutations
from math import comb, erf, exp, factorial, pi, sqrt

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxpf.likelihoods import (
    Features,
    detection_probabilities,
    line_weights,
    log_ratio,
    poisson_clutter,
)
from jaxpf.likelihoods.contours.line_model import log_ratios

LENGTH, REACH, SIGMA = 41.0, 20.5, 7.0
LEARNED = np.array([0.4, 0.25, 0.15, 0.1, 0.05, 0.03, 0.02])


MOST_BOUNDARIES, MOST_FEATURES = 5, 6


@jax.jit
def padded_log_ratio(clutter, places, present, boundaries, crossing):
    weights = line_weights(clutter, detection_probabilities(MOST_BOUNDARIES), LENGTH)
    return log_ratio(weights, Features(places, present), boundaries, crossing, SIGMA, REACH)


def ratio(places, boundaries):
    """``p~_c / p_0`` of one line, by the package: one compiled program for all cases."""
    features, crossed = (
        (np.pad(np.asarray(x, np.float32), (0, most - len(x))), np.arange(most) < len(x))
        for x, most in ((places, MOST_FEATURES), (boundaries, MOST_BOUNDARIES))
    )
    return float(np.exp(padded_log_ratio(LEARNED, *features, *crossed)))


def normal_law(z, nu):
    """G, from its definition."""

    def below(x):
        return 0.5 * (1 + erf((x - nu) / SIGMA / sqrt(2)))

    density = exp(-0.5 * ((z - nu) / SIGMA) ** 2) / (SIGMA * sqrt(2 * pi))
    return density / (below(REACH) - below(-REACH))


def brute_force(places, boundaries):
    """The same from the definitions of maccormick1999, section 2, term by term."""
    n, c = len(places), len(boundaries)
    law = np.array([[normal_law(z, nu) for z in places] for nu in boundaries]).reshape(c, n)
    q = detection_probabilities(MOST_BOUNDARIES)[c]
    density = 0.0
    for k in range(min(c, n) + 1):
        for seen in combinations(range(c), k):
            matched = sum(
                np.prod([law[j, i] for j, i in zip(seen, features, strict=True)])
                for features in permutations(range(n), k)
            )
            p_k = shown(LEARNED, n, k) * matched * factorial(n - k) / factorial(n)
            density += q[k] / comb(c, k) * p_k / LENGTH ** (n - k)
    return density / (shown(LEARNED, n, 0) / LENGTH**n)


def shown(clutter, n, k):
    """Probability of n features, k of them boundaries': at the most that are kept, n or more."""
    return clutter[n - k] if n < MOST_FEATURES else 1 - sum(clutter[: n - k])


@pytest.mark.parametrize("num_features", range(7))
@pytest.mark.parametrize("num_boundaries", range(1, 6))
def test_the_subset_recursion_equals_brute_force(num_features, num_boundaries):
    rng = np.random.default_rng(10 * num_features + num_boundaries)
    places = rng.uniform(-20, 20, num_features)
    boundaries = rng.uniform(-20, 20, num_boundaries)
    np.testing.assert_allclose(
        ratio(places, boundaries), brute_force(places, boundaries), rtol=2e-4
    )


def test_a_group_of_boundaries_is_a_line_that_no_other_crosses():
    boundaries, places = np.linspace(-15, 15, MOST_BOUNDARIES), (-12.0, -3.0, 1.0, 14.0)
    groups = (), (3,), (4, 0), (0, 1, 2, 3), tuple(range(MOST_BOUNDARIES))
    weights = line_weights(LEARNED, detection_probabilities(MOST_BOUNDARIES), LENGTH)
    features = Features(jnp.array(places), jnp.ones(len(places), bool))
    there = np.ones(MOST_BOUNDARIES, bool)
    ratios = jax.jit(log_ratios, static_argnums=6)
    found = ratios(weights, features, jnp.asarray(boundaries), there, SIGMA, REACH, groups)
    expected = [brute_force(places, boundaries[list(group)]) for group in groups]
    np.testing.assert_allclose(np.exp(found), expected, rtol=2e-5)


def test_no_feature_serves_two_boundaries():
    """With one feature, two boundaries on it are worth the detection of one, not of both."""
    one_seen, q = ratio([0.0], [0.0]), detection_probabilities(2)[2]
    at_feature = (one_seen - 0.1) / 0.9
    both = ratio([0.0], [0.0, 0.0])
    assert both == pytest.approx(q[0] + q[1] * at_feature, rel=1e-4)
    # With i = j included the pair would count as detected both.
    shared = q[2] * LENGTH**2 * LEARNED[0] / LEARNED[1] * normal_law(0.0, 0.0) ** 2
    assert both < 0.5 * (both + shared)


def test_a_boundary_that_is_not_there_changes_nothing():
    places, present = np.zeros(MOST_FEATURES, np.float32), np.arange(MOST_FEATURES) < 2

    def found(boundaries, crossing):
        boundaries = np.pad(np.array(boundaries, np.float32), (0, 3))
        crossing = np.pad(np.array(crossing), (0, 3))
        return float(padded_log_ratio(LEARNED, places, present, boundaries, crossing))

    assert found([3.0, 2.0], [False, True]) == pytest.approx(found([2.0, 9.0], [True, False]))
    assert found([2.0, 3.0], [False, False]) == 0.0


def test_poisson_clutter_gives_powers_of_the_density_of_features():
    mean = 0.7
    clutter, detection = np.asarray(poisson_clutter(mean, 6)), detection_probabilities(2)
    weights = np.asarray(jax.jit(line_weights)(clutter, detection, LENGTH))
    for k in range(3):
        scale = detection[2, k] / comb(2, k) * (LENGTH / mean) ** k
        np.testing.assert_allclose(weights[k, 2, k:-1], scale, rtol=1e-4)
        np.testing.assert_array_equal(weights[k, 2, :k], 0)
    assert 1 - clutter.sum() == pytest.approx(1.2e-5, rel=0.3)


@pytest.mark.parametrize(
    "boundaries",
    [
        *((), (4.0,), (-3.0, 5.0), (0.0, 18.0, 19.0)),
        pytest.param((0.0, 1.0, 2.0, 3.0, 4.0), marks=pytest.mark.slow),
        pytest.param((-9.0, 0.0, 2.0, 18.0), marks=pytest.mark.slow),
    ],
)
def test_what_a_line_shows_is_a_density_to_the_last_feature(boundaries):
    """In double precision, by summation over n up to the most that are kept, and over z.

    Also where more boundaries cross than features are kept.
    """
    most, c, cells = 3, len(boundaries), 24
    clutter = np.array([0.2, 0.3, 0.2, 0.3])  # the last is three or more
    # Gauss's points: exact for what is smooth.
    points, shares = np.polynomial.legendre.leggauss(cells)
    places = np.stack(np.meshgrid(*[points * REACH] * most, indexing="ij")).reshape(most, -1)
    share = np.prod(np.meshgrid(*[shares / 2] * most, indexing="ij"), axis=0).ravel()
    with jax.enable_x64(True):
        nu = np.reshape(boundaries, (c, 1)) * np.ones_like(share)

        @jax.jit
        def log_ratios_of(present):
            weights = line_weights(clutter, detection_probabilities(max(c, 1)), LENGTH)
            features = Features(places, present)
            return log_ratio(weights, features, nu, np.ones(nu.shape, bool), SIGMA, REACH)

        total = 0.0
        for n in range(most + 1):
            found = log_ratios_of(np.broadcast_to(np.arange(most)[:, None] < n, places.shape))
            total += clutter[n] * float(share @ np.broadcast_to(np.exp(found), share.shape))
    assert total == pytest.approx(1, abs=1e-9)


def test_long_lines_with_many_boundaries_have_finite_weights():
    """The length to the eighth power does not fit into a whole number of 32 bits."""
    weights = np.asarray(line_weights(LEARNED, detection_probabilities(6), 253))
    assert np.isfinite(weights).all()
    assert (weights >= 0).all()
    assert weights[6, 6, 6] > 1e6


def test_more_than_two_boundaries_extend_the_papers_probabilities():
    table = detection_probabilities(5)
    np.testing.assert_allclose(table.sum(axis=1), 1)
    np.testing.assert_allclose(table[2, :3], (0.05, 0.2, 0.75))
    expected = (table[2:] @ np.arange(6)) / np.arange(2, 6)
    np.testing.assert_allclose(expected, 0.85)  # each boundary as likely as of two


@jax.jit
def derivatives(features, *arguments):
    def total(boundaries, sigma, clutter, detection):
        weights = line_weights(clutter, detection, LENGTH)
        crossing = jnp.abs(boundaries) <= REACH
        return log_ratio(weights, features, boundaries, crossing, sigma, REACH)

    return jax.grad(total, argnums=(0, 1, 2, 3))(*arguments)


@pytest.mark.parametrize("places", [(), (0.0,), (-19.0, 3.0, 20.0)])
@pytest.mark.parametrize("nu", [(0.0, 0.0), (-20.5, 500.0)])
def test_derivatives_are_finite_whatever_is_found(places, nu):
    present = np.arange(3) < len(places)
    features = Features(np.pad(np.array(places, float), (0, 3 - len(places))), present)
    detection = detection_probabilities(2)

    gradients = derivatives(features, np.array(nu), SIGMA, LEARNED, detection)
    assert all(np.isfinite(gradient).all() for gradient in gradients)


def test_an_impossible_line_is_minus_infinity_without_a_broken_derivative():
    certain = np.array([[1.0, 0.0], [0.0, 1.0]])  # a boundary is always detected
    none = Features(np.zeros(2, np.float32), np.zeros(2, bool))

    def total(boundary):
        weights = line_weights(LEARNED, certain, LENGTH)
        return log_ratio(weights, none, boundary[None], jnp.ones(1, bool), SIGMA, REACH)

    value, slope = jax.jit(jax.value_and_grad(total))(0.0)
    assert float(value) == -np.inf
    assert float(slope) == 0.0
