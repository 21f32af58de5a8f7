"""Colour-histogram likelihood: exact against brute force, and honest about its limits."""

import dataclasses
import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from histograms import (
    WIDTH,
    brute_log_prob,
    full_references,
    log_prob,
    noise,
    observe,
    observe_all,
    values,
)

from jaxpf.likelihoods import histogram, histogram_from_patches

#: Frames and boxes are of few sizes, so that the tests share programs: noise of 60 x 80 pixels
#: seen in three boxes, one colour or two on 300 x 300 seen in one, all with two bands.
RED = np.full((300, 300, 3), (255, 0, 0), np.uint8)


@pytest.mark.parametrize("bands", [1, 2, 3])
def test_integral_equals_brute_force(bands, boxes, substates):
    frame = noise()
    likelihood = histogram(frame, boxes, bands=bands, method="integral", sharpness=30.0)
    # A strange frame, so that bins without a table occur.
    frame = np.where(np.arange(WIDTH)[None, :, None] < 40, frame, noise(8) // 2)
    partition = np.arange(substates.shape[1]) % len(boxes)
    got = values(likelihood, observe(likelihood, frame), partition, substates)
    references = full_references(likelihood)
    expected = [
        brute_log_prob(frame, references, boxes[:, 2:], p, s, 30.0, bands)
        for p, s in zip(partition, substates.T, strict=True)
    ]
    np.testing.assert_allclose(got, expected, atol=2e-4)


@pytest.mark.parametrize("interpolation", ["nearest", "bilinear"])
def test_a_frame_of_a_stack_of_tables_counts_as_alone(interpolation, boxes, substates):
    frames = np.stack([noise(seed) for seed in (0, 8, 9)])
    likelihood = histogram(frames[0], boxes, method="integral", interpolation=interpolation)
    partition = np.arange(substates.shape[1]) % len(boxes)
    stack = observe_all(likelihood, frames)
    for index, frame in enumerate(frames):
        alone = values(likelihood, observe(likelihood, frame), partition, substates)
        within = values(likelihood, stack.take_frame(index), partition, substates)
        np.testing.assert_array_equal(alone, within)


@pytest.mark.parametrize("interpolation", ["nearest", "bilinear"])
def test_wrapped_counts_are_exact(interpolation):
    # 90 000 pixels of one colour: every count beyond 2^16 has wrapped.
    likelihood = histogram(
        RED, [[200, 200, 100, 60]], method="integral", interpolation=interpolation
    )
    assert likelihood.table_dtype == "uint16"
    observation = observe(likelihood, RED)
    assert observation.cells.dtype == jnp.uint16
    assert np.asarray(observation.cells)[-1, -1].max() == 90_000 - 2**16
    at = np.array([[250.0, 150, 150, 150], [260.0, 150, 150, 150], [1.0, 1, 2.75, 5]])
    got = values(likelihood, observation, 0, at)
    # The last box is 500 x 300, of which 300 x 300 are in the frame, 45 000 in each part.
    np.testing.assert_allclose(got, [0, 0, 0, -20 * 2 * (1 - np.sqrt(0.6))], atol=1e-3)


def test_a_part_with_65536_pixels_is_refused_under_uint16_and_not_under_uint32():
    small = histogram(RED, [[0, 0, 50, 50]], bands=1, method="integral")
    assert small.table_dtype == "uint16"
    at = np.array([[128.0, 128.0], [128.0, 128.0], [255 / 50, 256.1 / 50]])
    both = values(small, observe(small, RED), 0, at)
    np.testing.assert_allclose(both, [0, -np.inf], atol=1e-4)
    large = histogram(RED, [[0, 0, 300, 300]], bands=1, method="integral")
    assert large.table_dtype == "uint32"
    one = log_prob(large, observe(large, RED), 0, np.array([150.0, 150.0, 1.0]))
    np.testing.assert_allclose(one, 0, atol=1e-4)


@pytest.mark.parametrize("method", ["integral", "sampled"])
def test_non_finite_substates_give_nan_and_tiny_boxes_minus_infinity(method, boxes):
    likelihood = histogram(noise(), boxes, method=method)
    nan, inf = np.nan, np.inf
    at = np.array(
        [[nan, 20, 20, inf, 20, 20, 20, 20], [20, nan, 20, 20, -inf, 20, 20, 20],
         [1, 1, nan, 1, 1, 0, -1, 0.05]]
    )  # fmt: skip
    got = values(likelihood, observe(likelihood, noise()), 0, at)
    assert np.isnan(got[:5]).all()
    assert np.isneginf(got[5:]).all()


@pytest.mark.parametrize("method", ["integral", "sampled"])
def test_gradients_are_finite_even_where_the_value_is_not(method, boxes):
    likelihood = histogram(noise(), boxes, method=method)
    observation = observe(likelihood, noise())
    at = np.array([[20.0, -500, 20, 3], [20.0, 20, 20, 3], [1.0, 1, 0, 1]])

    @jax.jit
    @functools.partial(jax.value_and_grad, argnums=(0, 1))
    def total(parameters, at):
        changed = dataclasses.replace(likelihood, **parameters)
        log_prob = changed.log_prob_all(observation, np.array([0, 1, 2, 1]), at)
        return jnp.sum(jnp.where(jnp.isfinite(log_prob), log_prob, 0))

    names = "sharpness", "references", "sizes"
    value, gradients = total({name: getattr(likelihood, name) for name in names}, at)
    assert all(np.isfinite(gradient).all() for gradient in jax.tree.leaves(gradients))
    expected = value / likelihood.sharpness
    np.testing.assert_allclose(gradients[0]["sharpness"], expected, rtol=1e-5)


@pytest.mark.parametrize("method", ["integral", "sampled"])
def test_the_result_has_the_dtype_of_the_substates_under_x64(method, boxes, substates):
    single = histogram(noise(), boxes, method=method)
    at = substates.astype(np.float32)
    expected = values(single, observe(single, noise()), 0, at)
    assert expected.dtype == np.float32
    with jax.enable_x64(True):
        double = histogram(noise(), boxes, method=method)
        observation = observe(double, noise())
        for dtype in (np.float32, np.float64):
            got = values(double, observation, 0, at.astype(dtype))
            assert got.dtype == dtype
            np.testing.assert_allclose(got, expected, atol=1e-4)


def test_references_learned_from_patches(boxes):
    frame = noise()
    patches = [frame[int(y) : int(y + h), int(x) : int(x + w)] for x, y, w, h in boxes]
    from_boxes = histogram(frame, boxes)
    from_patches = histogram_from_patches(patches, boxes[:, 2:])
    np.testing.assert_array_equal(from_boxes.references, from_patches.references)
    np.testing.assert_array_equal(from_boxes.sizes, histogram_from_patches(patches).sizes)


def test_many_particles_for_a_frame_share_a_table_unless_a_method_is_named():
    frame, box = noise(0, 288, 360), [[100, 100, 32, 42]]
    assert histogram(frame, box).method == "sampled"
    assert histogram(frame, box * 7).method == "integral"
    assert histogram(frame, box, num_particles=3000).method == "integral"
    assert histogram(frame, box * 7, method="sampled").method == "sampled"
    assert histogram(frame, box, interpolation="bilinear").method == "integral"
