"""Histograms of sampled pixels: counted one by one, and close to exact ones."""

import jax
import numpy as np
import pytest
from histograms import (
    HEIGHT,
    WIDTH,
    float_bins,
    full_references,
    log_prob_in_frame,
    noise,
    smooth_frame,
)

import scenes
from jaxpf.likelihoods import histogram, histogram_from_patches
from jaxpf.likelihoods.color import NUM_BINS, hsv_bins


def test_sampled_is_close_to_integral_but_for_a_known_bias():
    frame, boxes = smooth_frame(), [[30, 30, 32, 42]]
    rng = np.random.default_rng(2)
    count = 400
    at = [[46], [51], [1]] + np.array([[4], [4], [0.05]]) * rng.normal(size=(3, count))
    partition = np.zeros(count, int)

    def distance(method, samples):
        likelihood = histogram(frame, boxes, sharpness=1.0, method=method, samples=samples)
        return -np.asarray(log_prob_in_frame(likelihood, frame, partition, at))

    exact = distance("integral", 16)
    num_bins = len(np.unique(hsv_bins(frame)))
    for samples, bound in ((16, 0.03), (32, 0.01)):
        error = distance("sampled", samples) - exact
        assert 0 < error.mean() < 2 * (num_bins - 1) / (8 * samples**2 / 2)
        assert error.std() < bound


def counted_one_by_one(likelihood, frame, partition, substate):
    """The sampled likelihood's definition, in float64 and loops."""
    bins, references = float_bins(frame), full_references(likelihood)[partition]
    u, v, scale, theta = (float(x) for x in substate)
    width, height = np.asarray(likelihood.sizes, float)[partition] * scale
    num_bands, d = len(references), likelihood.distance
    columns, rows = -(-likelihood.samples // 2), -(-likelihood.samples // (2 * num_bands))
    similarity = 0.0
    for band in range(num_bands):
        counts = np.zeros(NUM_BINS)
        for i in range(band * rows, (band + 1) * rows):
            for j in range(columns):
                a = ((j + 0.5) / columns - 0.5) * width
                b = ((i + 0.5) / (rows * num_bands) - 0.5) * height
                x = int(np.floor(u + np.cos(theta) * a - np.sin(theta) * b - d / 2))
                y = int(np.floor(v + np.sin(theta) * a + np.cos(theta) * b - d / 2))
                for row, column in ((y, x), (y, x + d), (y + d, x), (y + d, x + d)):
                    if 0 <= row < frame.shape[0] and 0 <= column < frame.shape[1]:
                        counts[bins[row, column]] += 1
        similarity += np.sqrt(counts / (4 * rows * columns) * references[band]).sum()
    return -float(likelihood.sharpness) * (num_bands - similarity)


@pytest.mark.parametrize(
    ("bands", "samples", "single"), [(1, 10, False), (2, 16, True), (3, 7, False), (1, 36, False)]
)
def test_sampled_equals_a_count_of_its_samples_one_by_one(bands, samples, single, boxes):
    frame, rng = noise(12), np.random.default_rng(3)
    likelihood = histogram(frame, boxes, bands=bands, method="sampled", samples=samples)
    count = 40
    at = np.stack([
        rng.uniform(-10, WIDTH + 10, count), rng.uniform(-10, HEIGHT + 10, count),
        rng.uniform(0.5, 2, count), rng.uniform(-7, 7, count),
    ])  # fmt: skip
    partition = np.arange(count) % len(boxes)
    with jax.enable_x64(True):
        double = histogram(frame, boxes, bands=bands, method="sampled", samples=samples)
        got = log_prob_in_frame(double, frame, partition, at)
    expected = [
        counted_one_by_one(likelihood, frame, p, x) for p, x in zip(partition, at.T, strict=True)
    ]
    np.testing.assert_allclose(got, expected, atol=1e-5)
    if single:
        # In float32 a sample on the edge of a pixel may fall to its other side.
        found = np.asarray(log_prob_in_frame(likelihood, frame, partition, at.astype(np.float32)))
        assert np.mean(np.abs(found - expected) < 1e-4) > 0.9
        np.testing.assert_allclose(found, expected, atol=2)


@pytest.mark.parametrize(
    "bounds",
    [
        {8: (0.03, 0.027), 16: (0.006, 0.011)},
        pytest.param({10: (0.018, 0.018), 12: (0.015, 0.016)}, marks=pytest.mark.slow),
    ],
)
def test_sampled_is_close_to_counting_every_pixel_of_a_rotated_box(bounds):
    # The figures that articulated trackers rest on; see jaxpf/likelihoods/_sampled.py.
    scene = scenes.make("articulated", 2, num_parts=11, num_frames=1)
    bins, rng = float_bins(scene.frames[0]), np.random.default_rng(0)
    part = rng.integers(0, 11, 300)
    spread = np.array([4, 4, 0.15]) * rng.choice([0.3, 1], (300, 1))
    poses = scene.extras["poses"][0][part] + spread * rng.normal(size=(300, 3))
    rows, columns = np.mgrid[: bins.shape[0], : bins.shape[1]] + 0.5
    distance = {}
    for samples in bounds:
        likelihood = histogram_from_patches(
            scene.patches, sharpness=1.0, bands=1, method="sampled", samples=samples
        )
        at = np.insert(poses, 2, 1, axis=1).T
        found = log_prob_in_frame(likelihood, scene.frames[0], part, at)
        distance[samples] = -np.asarray(found)
    references, exact = full_references(likelihood)[:, 0], []
    for p, (x, y, theta) in zip(part, poses, strict=True):
        turned = (columns - x + 1j * (rows - y)) * np.exp(-1j * theta)
        width, height = scene.sizes[p]
        inside = (np.abs(turned.real) < width / 2) & (np.abs(turned.imag) < height / 2)
        share = np.bincount(bins[inside], minlength=NUM_BINS) / inside.sum()
        exact.append(1 - np.sqrt(share * references[p]).sum())
    for samples, (bias, deviation) in bounds.items():
        error = distance[samples] - np.array(exact)
        print(f"{samples} samples per side: bias {error.mean():.4f}, deviation {error.std():.4f}")
        assert abs(error.mean()) < bias
        assert error.std() < deviation
