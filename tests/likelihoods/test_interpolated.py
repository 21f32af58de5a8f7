"""Likelihoods that are differentiable in the substate, and ones that integrate to 1."""

import dataclasses
import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from histograms import texture

import scenes
from jaxpf.likelihoods import (
    histogram,
    histogram_from_patches,
    log_normaliser,
    log_tilt,
)
from jaxpf.likelihoods.distance_law import FORMS, compressed, learn_background, log_density

HEIGHT, WIDTH = 60, 80
#: Blots of some pixels, so that bins have edges inside the boxes.
PICTURE, OTHER = texture(0, HEIGHT, WIDTH), texture(2, HEIGHT, WIDTH)
BOXES = np.array([[10, 12, 16, 24], [40, 20, 9, 12]], float)


def made(kind, **options):
    """One likelihood for all tests of a kind and precision."""
    return _made(kind, bool(jax.config.jax_enable_x64), **options)


@functools.cache
def _made(kind, float64, **options):
    return histogram(
        PICTURE, BOXES, method=kind, samples=9, interpolation="bilinear", sharpness=3.0, **options
    )


@jax.jit
def observe(likelihood, frame):
    return likelihood.observe(frame)


@jax.jit
def value_and_gradient(likelihood, observation, partition, substates):
    """Log-likelihoods [N], and the gradient [D, N] of the finite ones in the substates."""

    def total(substates):
        value = likelihood.log_prob_all(observation, partition, substates)
        return jnp.sum(jnp.where(jnp.isfinite(value), value, 0)), value

    gradient, value = jax.grad(total, has_aux=True)(substates)
    return value, gradient


def poses(count, dimension, seed=1):
    """All over the frame and beyond its borders, none on a pixel's edge."""
    rng = np.random.default_rng(seed)
    columns = [
        rng.uniform(-15, WIDTH + 15, count),
        rng.uniform(-15, HEIGHT + 15, count),
        rng.uniform(0.4, 2.0, count),
        rng.uniform(-np.pi, np.pi, count),
    ]
    return rng.integers(0, 2, count), np.stack(columns[:dimension])


#: Particles of the tests in float64 and in float32: one program each for all tests of a case.
MANY, SOME = 3001, 300
CASES = [("integral", 3), ("sampled", 3), ("sampled", 4)]


@pytest.mark.parametrize(
    ("kind", "dimension"),
    [pytest.param(*case, marks=[pytest.mark.slow] * (case[1] == 4)) for case in CASES],
)
@pytest.mark.parametrize("form", ["exponential", pytest.param("ratio", marks=pytest.mark.slow)])
def test_the_gradient_in_position_scale_and_angle_matches_finite_differences(kind, dimension, form):
    with jax.enable_x64(True):
        likelihood = made(kind, form=form)
        observation = observe(likelihood, OTHER)
        partition, substates = poses(MANY, dimension)

        def value(substates):
            return np.asarray(value_and_gradient(likelihood, observation, partition, substates)[0])

        gradient = np.asarray(value_and_gradient(likelihood, observation, partition, substates)[1])
        assert np.isfinite(gradient).all()
        step = 1e-6
        for axis in range(dimension):
            shift = step * np.eye(dimension)[:, [axis]]
            difference = (value(substates + shift) - value(substates - shift)) / 2 / step
            # A place that crosses a pixel's edge within the step has no derivative there: rare.
            close = np.isclose(gradient[axis], difference, rtol=1e-4, atol=1e-4)
            assert close.mean() > 0.99, (axis, gradient[axis][~close], difference[~close])
            assert np.mean(np.abs(gradient[axis]) > 1e-3) > 0.35


@pytest.mark.parametrize(("kind", "dimension"), CASES)
def test_the_value_is_continuous_where_whole_pixels_jump(kind, dimension):
    with jax.enable_x64(True):
        likelihood = made(kind)
        observation = observe(likelihood, OTHER)
        steps = np.linspace(0, 3, MANY)
        first = np.zeros(MANY, int)
        along = np.repeat([[31.3], [27.9], [1.1], [0.4]][:dimension], len(steps), axis=1)
        for axis in range(dimension):
            line = along.copy()
            line[axis] += steps * (0.1 if axis > 1 else 1.0)
            value, _ = value_and_gradient(likelihood, observation, first, line)
            assert np.max(np.abs(np.diff(value))) < 0.02 * np.ptp(value)


@pytest.mark.parametrize("method", ["integral", "sampled"])
def test_it_agrees_with_whole_pixels(method):
    sharpness = 3.0
    smooth = made(method)
    exact = histogram(PICTURE, BOXES, method="integral", sharpness=sharpness)
    partition, substates = poses(SOME, 3)
    substates = substates.astype(np.float32)

    def squared_distance(likelihood, substates):
        seen = observe(likelihood, OTHER)
        value, _ = value_and_gradient(likelihood, seen, partition, substates)
        return np.asarray(value) / -sharpness

    squared, truth = squared_distance(smooth, substates), squared_distance(exact, substates)
    assert np.mean(np.abs(squared - truth)) < 0.05
    assert np.corrcoef(squared, truth)[0, 1] > 0.985
    if method == "integral":  # on whole pixels the same boxes, but for the rounded root
        partition[:3] = 0
        substates[:, :3] = [20, 41, 8], [30, 18, 7], [1, 1, 1]
        a, b = (squared_distance(one, substates)[:3] for one in (smooth, exact))
        np.testing.assert_allclose(a, b, atol=0.02)


@pytest.mark.parametrize("method", ["integral", "sampled"])
def test_boxes_without_a_pixel_and_numbers_that_are_none_keep_finite_gradients(method):
    likelihood = made(method)
    partition, substates = poses(SOME, 3)
    partition[:4] = 0
    substates[:, :4] = [20, 5000, -4000, 20], [20, 20, -900, 20], [1, 1, 1, 0.01]
    seen, substates = observe(likelihood, OTHER), substates.astype(np.float32)
    value, gradient = map(np.asarray, value_and_gradient(likelihood, seen, partition, substates))
    np.testing.assert_allclose(value[1:3], -3.0 * 2, rtol=1e-5)
    assert value[3] == -np.inf
    assert np.isfinite(gradient).all()
    assert (gradient[:, 1:4] == 0).all()


# Forms


@jax.jit
def of_all_forms(sharpness, bands, background, squared):
    """Every form's log of the first object's values."""
    first = jnp.zeros(len(squared), int)
    return {form: log_density(form, sharpness, bands, background, first, squared) for form in FORMS}


#: A background for the forms that need none.
NONE = np.zeros((1, 2, 1))


@pytest.mark.parametrize("sharpness", [1e-3, 0.5, 4.0, 20.0, 500.0])
@pytest.mark.parametrize("bands", [1, 2])
def test_the_density_of_the_distance_integrates_to_one(sharpness, bands):
    with jax.enable_x64(True):
        grid = np.linspace(0, bands, 400_001)
        values = of_all_forms(sharpness, bands, NONE, grid)
        log_f, plain = np.asarray(values["density"]), np.asarray(values["exponential"])
        assert abs(np.trapezoid(np.exp(log_f), grid) - 1) < 1e-5
        normaliser = jax.jit(log_normaliser)(sharpness, bands)
        np.testing.assert_allclose(plain - log_f, normaliser, rtol=1e-8)
        assert abs(np.trapezoid(np.exp(plain), grid) - 1) > 1e-4


@pytest.mark.parametrize("sharpness", [1e-3, 4.0, 20.0])
def test_the_ratio_times_the_background_integrates_to_one(sharpness):
    """Against a known background density, whose samples stand for it."""
    with jax.enable_x64(True):
        grid = np.linspace(0, 2, 200_001)
        background = 30 * (grid / 2) ** 4 * (1 - grid / 2) / 2  # Beta(5, 2) on [0, 2]
        samples = np.random.default_rng(0).beta(5, 2, 400_000) * 2
        samples = np.stack([samples, np.full(samples.size, -np.log(samples.size))])[None]
        ratio = np.asarray(of_all_forms(sharpness, 2, samples, grid)["ratio"])
        exact = np.trapezoid(background * np.exp(-sharpness * grid), grid)
        # Relative standard error of the mean of exp(-S s) over the samples.
        error = np.std(np.exp(-sharpness * samples[0, 0])) / exact / np.sqrt(samples.size / 2)
        assert abs(np.trapezoid(np.exp(ratio) * background, grid) - 1) < 4 * error + 1e-6
        tilt = np.exp(jax.jit(log_tilt)(sharpness, samples[0]))
        assert abs(tilt / exact - 1) < 4 * error + 1e-6


def evidence_of(scene, form, sharpness):
    """Log evidence of the scene's objects at places around the truth, averaged over places."""
    likelihood = histogram_from_patches(
        scene.patches,
        method="integral",
        form=form,
        background_frames=scene.frames[[0, 9, 12]],
    )
    offsets = np.random.default_rng(0).normal(0, 3, (2, 200))

    @jax.jit
    def evidence(sharpness):
        one = dataclasses.replace(likelihood, sharpness=sharpness)
        total = 0.0
        for t in (9, 12):
            observation = one.observe(jnp.asarray(scene.frames[t]))
            for p in range(1, 4):
                centre = scene.boxes[t, p, :2] + scene.boxes[t, p, 2:] / 2
                substates = jnp.concatenate([centre[:, None] + offsets, jnp.ones((1, 200))])
                log_prob = one.log_prob_all(
                    observation, jnp.full(200, p), substates.astype(jnp.float32)
                )
                total += jax.nn.logsumexp(log_prob) - np.log(200)
        return total

    return np.array([evidence(float(s)) for s in sharpness])


@pytest.mark.slow
def test_the_evidence_has_a_maximum_in_the_sharpness_where_it_is_normalised():
    scene = scenes.make("distracter", seed=0)
    sharpness = np.geomspace(0.1, 1000, 13)
    plain = evidence_of(scene, "exponential", sharpness)
    assert (np.diff(plain) < 0).all(), "exp(-S d^2) always prefers S = 0"
    for form in ("density", "ratio"):
        values = evidence_of(scene, form, sharpness)
        assert 0 < np.argmax(values) < len(sharpness) - 1, values


def test_boxes_of_a_frame_are_far_from_the_references_but_where_the_object_is():
    scene = scenes.make("distracter", seed=0)
    likelihood = histogram_from_patches(scene.patches, method="integral")
    squared, log_share = np.moveaxis(
        np.asarray(learn_background(likelihood, scene.frames[0])), 1, 0
    )
    share = np.exp(log_share)
    np.testing.assert_allclose(share.sum(axis=1), 1, rtol=1e-5)
    assert ((share * squared).sum(axis=1) > 1.4).all()
    assert (squared[1:].min(axis=1) < 0.2).all()
    np.testing.assert_allclose(1 / share.min(axis=1), 329 * 247, rtol=1e-4)  # every pixel


def test_groups_of_boxes_stand_for_their_members():
    squared = np.random.default_rng(0).beta(5, 2, 50_000) * 2
    values, log_share = compressed(squared)
    assert len(values) < 2000
    with jax.enable_x64(True):
        for sharpness in (0.1, 5.0, 50.0, 500.0):
            exact = np.log(np.mean(np.exp(-sharpness * squared)))
            found = jax.jit(log_tilt)(sharpness, np.stack([values, log_share]))
            assert abs(found - exact) < 0.01


def test_objects_of_two_sizes_in_a_small_frame_have_the_backgrounds_that_they_have_alone():
    small, boxes = (
        PICTURE[:44, :60],
        np.array([[10.0, 12, 16, 24], [40, 20, 9, 12]]),
    )
    both = np.asarray(histogram(small, boxes, form="ratio").background)
    for place, box in enumerate(boxes):
        alone = np.asarray(histogram(small, box[None], form="ratio").background)[0]
        np.testing.assert_allclose(both[place, :, : alone.shape[1]], alone, rtol=1e-5, atol=1e-6)
        assert np.isneginf(both[place, 1, alone.shape[1] :]).all()
    assert np.isneginf(both[0, 1]).any()  # the larger one has fewer places
