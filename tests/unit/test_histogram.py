"""Colour-histogram likelihood: exact against brute force, and honest about its limits."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import scenes
from jaxpf.errors import InputError
from jaxpf.models.likelihoods.color import NUM_BINS, hsv_bins
from jaxpf.models.likelihoods.histogram import (
    HistogramLikelihood,
    estimated_costs,
    histogram,
    histogram_from_patches,
)

HEIGHT, WIDTH = 60, 80


# Compiled as a whole: in tests of many shapes, one compilation per operation is slow.
observe = jax.jit(HistogramLikelihood.observe)
log_prob = jax.jit(HistogramLikelihood.log_prob)
log_prob_all = jax.jit(HistogramLikelihood.log_prob_all)


def numpy_bins(frame):
    """Perez et al.'s bins in exact integer arithmetic, pixel by pixel."""
    result = np.zeros(frame.shape[:-1], int)
    for place in np.ndindex(result.shape):
        red, green, blue = (int(c) for c in frame[place])
        top, chroma = max(red, green, blue), max(red, green, blue) - min(red, green, blue)
        if 10 * chroma > top and 5 * top > 255:
            if top == red:
                sixths = (green - blue) % (6 * chroma)
            elif top == green:
                sixths = blue - red + 2 * chroma
            else:
                sixths = red - green + 4 * chroma
            hue, saturation = 10 * sixths // (6 * chroma), 10 * chroma // top
            result[place] = 10 * min(hue, 9) + min(saturation, 9)
        else:
            result[place] = 100 + min(10 * top // 255, 9)
    return result


def float_bins(frame):
    """Perez et al.'s bins by the formulas of HSV, float64."""
    color = frame.astype(np.float64) / 255
    red, green, blue = np.moveaxis(color, -1, 0)
    value = color.max(-1)
    chroma = value - color.min(-1)
    saturation = chroma / np.where(value > 0, value, 1)
    safe = np.where(chroma > 0, chroma, 1)
    hue = np.where(
        value == red,
        ((green - blue) / safe) % 6,
        np.where(value == green, (blue - red) / safe + 2, (red - green) / safe + 4),
    )

    def level(x):  # a hair up: 0.7 / 0.1 is not quite 7 in float64
        return np.minimum(np.floor(10 * x + 1e-9), 9).astype(int)

    coloured = (saturation > 0.1 + 1e-12) & (value > 0.2 + 1e-12)
    return np.where(coloured, 10 * level(hue / 6) + level(saturation), 100 + level(value))


def brute_log_prob(frame, references, sizes, partition, substate, sharpness, parts):
    """One box, its pixels counted one part at a time; references [P, parts, 110]."""
    u, v, scale = (float(x) for x in substate)
    width, height = sizes[partition] * scale
    if width < 1 or height < parts:
        return -np.inf
    bins = float_bins(frame)
    left, right = (int(np.floor(x + 0.5)) for x in (u - width / 2, u + width / 2))
    edges = [int(np.floor(v - height / 2 + height * k / parts + 0.5)) for k in range(parts + 1)]
    distance = 0.0
    for k in range(parts):
        inside = bins[max(edges[k], 0) : max(edges[k + 1], 0), max(left, 0) : max(right, 0)]
        count = np.bincount(inside.ravel(), minlength=NUM_BINS)
        p = count / ((right - left) * (edges[k + 1] - edges[k]))
        distance += 1 - np.sqrt(p * references[partition, k]).sum()
    return -sharpness * distance


def noise(seed=0, height=HEIGHT, width=WIDTH):
    return np.random.default_rng(seed).integers(0, 256, (height, width, 3), dtype=np.uint8)


def full_references(likelihood):
    """References as histograms [P, parts, 110], undoing the compact numbering of bins."""
    roots = np.asarray(likelihood.references, np.float64)
    padded = np.concatenate([roots, np.zeros((*roots.shape[:2], 1))], -1)
    return padded[..., np.asarray(likelihood.bin_lookup)] ** 2


def dyadic(values, step=1 / 8):
    """Multiples of a power of two: box edges are then exact in float32 and never disagree."""
    return np.round(np.asarray(values) / step) * step


@pytest.fixture(scope="module")
def boxes():
    return np.array([[10, 12, 16, 24], [40, 20, 8, 12], [60, 30, 12, 12]], float)


@pytest.fixture(scope="module")
def likelihood(boxes):
    return histogram(noise(), boxes, method="integral")


@pytest.fixture(scope="module")
def substates():
    """Boxes all over the frame and beyond its borders."""
    rng = np.random.default_rng(1)
    count = 300
    u, v = rng.uniform(-15, WIDTH + 15, count), rng.uniform(-15, HEIGHT + 15, count)
    return np.stack([dyadic(u), dyadic(v), rng.choice([0.5, 0.75, 1, 1.25, 2], count)])


def test_bins_of_colours_known_by_hand():
    colours = {
        (255, 0, 0): 9, (255, 255, 0): 19, (0, 255, 0): 39, (0, 255, 255): 59,
        (0, 0, 255): 69, (255, 0, 255): 89, (255, 0, 1): 99, (255, 229, 229): 1,
        (255, 230, 230): 109, (51, 0, 0): 102, (52, 0, 0): 9, (0, 0, 0): 100,
        (26, 26, 26): 101, (255, 255, 255): 109, (10, 9, 10): 100, (200, 180, 180): 107,
    }  # fmt: skip
    got = hsv_bins(jnp.array(list(colours), jnp.uint8))
    assert got.tolist() == list(colours.values())


def test_bins_agree_with_exact_and_with_float64_arithmetic():
    frame = np.concatenate([noise(3), noise(4) // 4, noise(5) // 8 + 200, noise(6) // 64 * 51])
    got = np.asarray(hsv_bins(jnp.array(frame)))
    np.testing.assert_array_equal(got, numpy_bins(frame))
    np.testing.assert_array_equal(got, float_bins(frame))


def test_bins_agree_for_every_24_bit_colour():
    level = np.arange(256, dtype=np.uint8)
    binned = jax.jit(hsv_bins)
    for red in range(0, 256, 15):
        frame = np.stack(np.meshgrid([red], level, level, indexing="ij"), -1).astype(np.uint8)
        np.testing.assert_array_equal(np.asarray(binned(frame)), float_bins(frame))


@pytest.mark.parametrize("method", ["integral", "sampled"])
def test_histogram_of_a_two_coloured_box_by_hand(method):
    # Left half red, right half blue, all rows alike; a quarter of the box's left is off it.
    frame = np.zeros((40, 40, 3), np.uint8)
    frame[:, :20, 0], frame[:, 20:, 2] = 255, 255
    likelihood = histogram(frame, [[12, 8, 16, 16]], sharpness=10.0, method=method)
    at = jnp.array([[20.0, 24.0, 28.0, 36.0], [16.0] * 4, [1.0] * 4])
    observation = observe(likelihood, frame)
    got = log_prob_all(likelihood, observation, jnp.zeros(4, jnp.int32), at)
    # Coefficient of (p, 1 - p) with (1/2, 1/2); at 36 a quarter is off the frame.
    root = np.sqrt(0.5)
    expected = np.array([1, root * (0.5 + np.sqrt(0.75)), root, root * np.sqrt(0.75)])
    np.testing.assert_allclose(got, -10 * 2 * (1 - expected), atol=1e-5)


@pytest.mark.parametrize("parts", [1, 2, 3])
def test_integral_equals_brute_force(parts, boxes, substates):
    frame = noise(7)
    likelihood = histogram(frame, boxes, parts=parts, method="integral", sharpness=30.0)
    # A strange frame, so that bins without a table occur.
    frame = np.where(np.arange(WIDTH)[None, :, None] < 40, frame, noise(8) // 2)
    partition = np.arange(substates.shape[1]) % len(boxes)
    got = log_prob_all(
        likelihood,
        observe(likelihood, frame),
        jnp.array(partition),
        jnp.array(substates, jnp.float32),
    )
    references = full_references(likelihood)
    expected = [
        brute_log_prob(frame, references, boxes[:, 2:], p, s, 30.0, parts)
        for p, s in zip(partition, substates.T, strict=True)
    ]
    np.testing.assert_allclose(got, expected, atol=2e-4)


@pytest.mark.parametrize("interpolation", ["nearest", "bilinear"])
def test_a_frame_of_a_stack_of_tables_counts_as_alone(interpolation, boxes, substates):
    frames = np.stack([noise(seed) for seed in (7, 8, 9)])
    likelihood = histogram(frames[0], boxes, method="integral", interpolation=interpolation)
    partition = jnp.arange(substates.shape[1]) % len(boxes)
    at = jnp.array(substates, jnp.float32)
    stack = jax.vmap(likelihood.observe)(frames)
    for index, frame in enumerate(frames):
        alone = log_prob_all(likelihood, observe(likelihood, frame), partition, at)
        within = log_prob_all(likelihood, stack.take_frame(index), partition, at)
        np.testing.assert_array_equal(alone, within)


def test_wrapped_counts_are_exact():
    # 90 000 pixels of one colour: every count beyond 2^16 has wrapped.
    frame = np.full((300, 300, 3), (255, 0, 0), np.uint8)
    likelihood = histogram(frame, [[200, 200, 100, 60]], method="integral")
    assert likelihood.table_dtype == "uint16"
    observation = observe(likelihood, frame)
    assert observation.cells.dtype == jnp.uint16
    assert int(observation.cells[-1, -1].max()) == 90_000 - 2**16
    at = jnp.array([[250.0, 150, 150, 150], [260.0, 150, 150, 150], [1.0, 1, 2.75, 5]])
    got = log_prob_all(likelihood, observation, jnp.zeros(4, jnp.int32), at)
    # The last box is 500 x 300, of which 300 x 300 are in the frame, 45 000 in each part.
    np.testing.assert_allclose(got, [0, 0, 0, -20 * 2 * (1 - np.sqrt(0.6))], atol=1e-4)


def test_a_part_with_65536_pixels_is_refused_under_uint16_and_not_under_uint32():
    frame = np.full((300, 300, 3), (255, 0, 0), np.uint8)
    small = histogram(frame, [[0, 0, 50, 50]], parts=1, method="integral")
    assert small.table_dtype == "uint16"
    at = jnp.array([[128.0, 128.0], [128.0, 128.0], [255 / 50, 256.1 / 50]])
    both = log_prob_all(small, observe(small, frame), jnp.zeros(2, jnp.int32), at)
    np.testing.assert_allclose(both, [0, -np.inf], atol=1e-4)
    large = histogram(frame, [[0, 0, 300, 300]], parts=1, method="integral")
    assert large.table_dtype == "uint32"
    one = log_prob(large, observe(large, frame), 0, jnp.array([150.0, 150.0, 1.0]))
    np.testing.assert_allclose(one, 0, atol=1e-4)


def test_a_box_fully_outside_has_distance_parts(likelihood):
    observation = observe(likelihood, noise())
    for place in ([-1000.0, 20, 1], [1e9, 20, 1], [20.0, -50, 1], [20.0, 3e30, 1]):
        assert float(log_prob(likelihood, observation, 0, jnp.array(place))) == -20 * 2


def test_references_are_normalised_over_pixels_in_the_frame():
    frame = noise()
    for box in ([-8, -4, 20, 20], [70, 45, 20, 20], [5, 5, 9.5, 13.7]):
        total = full_references(histogram(frame, [box])).sum(-1)
        np.testing.assert_allclose(total, 1, rtol=1e-6)


def test_similarity_falls_smoothly_as_a_box_leaves_the_frame():
    frame = np.full((HEIGHT, WIDTH, 3), 255, np.uint8)
    likelihood = histogram(frame, [[0, 20, 16, 16]], sharpness=1.0, method="integral")
    u = jnp.arange(8.0, -9.0, -1.0)
    at = jnp.stack([u, jnp.full_like(u, 28), jnp.ones_like(u)])
    got = log_prob_all(likelihood, observe(likelihood, frame), jnp.zeros(17, jnp.int32), at)
    np.testing.assert_allclose(got, -2 * (1 - np.sqrt(np.arange(16, -1, -1) / 16)), atol=1e-6)


def smooth_frame():
    """Noise blurred over about ten pixels: neighbouring pixels share bins, as in a picture."""
    frame = noise(11, 120, 160).astype(float)
    for axis in (0, 1):
        for _ in range(3):
            frame = sum(np.roll(frame, k, axis) for k in range(-2, 3)) / 5
    frame = (frame - frame.min()) / np.ptp(frame) * 255
    return frame.astype(np.uint8)


def test_sampled_is_close_to_integral_but_for_a_known_bias():
    frame, boxes = smooth_frame(), [[30, 30, 32, 42]]
    rng = np.random.default_rng(2)
    count = 400
    at = [[46], [51], [1]] + np.array([[4], [4], [0.05]]) * rng.normal(size=(3, count))
    at = jnp.array(at, jnp.float32)
    partition = jnp.zeros(count, jnp.int32)

    def distance(method, samples):
        likelihood = histogram(frame, boxes, sharpness=1.0, method=method, samples=samples)
        return -np.asarray(log_prob_all(likelihood, observe(likelihood, frame), partition, at))

    exact = distance("integral", 16)
    num_bins = len(np.unique(hsv_bins(frame)))
    for samples, bound in ((16, 0.03), (32, 0.01)):
        error = distance("sampled", samples) - exact
        assert 0 < error.mean() < 2 * (num_bins - 1) / (8 * samples**2 / 2)
        assert error.std() < bound


def test_sampling_every_pixel_equals_the_integral_histogram():
    frame = noise()
    pair = [
        histogram(frame, [[20, 20, 16, 16]], method=m, samples=16) for m in ("integral", "sampled")
    ]
    at = jnp.array([[20.0, 33, -2, 79], [30.0, 41, 3, 55], [1.0] * 4])
    one, other = (log_prob_all(x, observe(x, frame), jnp.zeros(4, jnp.int32), at) for x in pair)
    np.testing.assert_allclose(one, other, atol=1e-4)


def counted_one_by_one(likelihood, frame, partition, substate):
    """The sampled likelihood's definition, in float64 and loops."""
    bins, references = float_bins(frame), full_references(likelihood)[partition]
    u, v, scale, theta = (float(x) for x in substate)
    width, height = np.asarray(likelihood.sizes, float)[partition] * scale
    num_parts, d = len(references), likelihood.distance
    columns, rows = -(-likelihood.samples // 2), -(-likelihood.samples // (2 * num_parts))
    similarity = 0.0
    for part in range(num_parts):
        counts = np.zeros(NUM_BINS)
        for i in range(part * rows, (part + 1) * rows):
            for j in range(columns):
                a = ((j + 0.5) / columns - 0.5) * width
                b = ((i + 0.5) / (rows * num_parts) - 0.5) * height
                x = int(np.floor(u + np.cos(theta) * a - np.sin(theta) * b - d / 2))
                y = int(np.floor(v + np.sin(theta) * a + np.cos(theta) * b - d / 2))
                for row, column in ((y, x), (y, x + d), (y + d, x), (y + d, x + d)):
                    if 0 <= row < frame.shape[0] and 0 <= column < frame.shape[1]:
                        counts[bins[row, column]] += 1
        similarity += np.sqrt(counts / (4 * rows * columns) * references[part]).sum()
    return -float(likelihood.sharpness) * (num_parts - similarity)


@pytest.mark.parametrize(("parts", "samples"), [(1, 10), (2, 16), (3, 7), (1, 36)])
def test_sampled_equals_a_count_of_its_samples_one_by_one(parts, samples, boxes):
    frame, rng = noise(12), np.random.default_rng(3)
    likelihood = histogram(frame, boxes, parts=parts, method="sampled", samples=samples)
    count = 40
    at = np.stack([
        rng.uniform(-10, WIDTH + 10, count), rng.uniform(-10, HEIGHT + 10, count),
        rng.uniform(0.5, 2, count), rng.uniform(-7, 7, count),
    ])  # fmt: skip
    partition = np.arange(count) % len(boxes)
    with jax.enable_x64(True):
        double = histogram(frame, boxes, parts=parts, method="sampled", samples=samples)
        got = log_prob_all(double, observe(double, frame), jnp.array(partition), jnp.array(at))
    single = log_prob_all(
        likelihood, observe(likelihood, frame), jnp.array(partition), jnp.array(at, jnp.float32)
    )
    expected = [
        counted_one_by_one(likelihood, frame, p, x) for p, x in zip(partition, at.T, strict=True)
    ]
    np.testing.assert_allclose(got, expected, atol=1e-5)
    # In float32 a sample on the edge of a pixel may fall to its other side.
    assert np.mean(np.abs(single - np.array(expected)) < 1e-4) > 0.9
    np.testing.assert_allclose(single, expected, atol=2)


def test_sampled_is_close_to_counting_every_pixel_of_a_rotated_box():
    # The figures that articulated trackers rest on; see jaxpf/likelihoods/_sampled.py.
    scene = scenes.make("articulated", 2, num_parts=11, num_frames=1)
    bins, rng = float_bins(scene.frames[0]), np.random.default_rng(0)
    part = rng.integers(0, 11, 300)
    spread = np.array([4, 4, 0.15]) * rng.choice([0.3, 1], (300, 1))
    poses = scene.extras["poses"][0][part] + spread * rng.normal(size=(300, 3))
    rows, columns = np.mgrid[: bins.shape[0], : bins.shape[1]] + 0.5
    distance = {}
    for samples in (8, 10, 12, 16):
        likelihood = histogram_from_patches(
            scene.patches, sharpness=1.0, parts=1, method="sampled", samples=samples
        )
        at = jnp.array(np.insert(poses, 2, 1, axis=1).T, jnp.float32)
        observation = observe(likelihood, scene.frames[0])
        distance[samples] = -log_prob_all(likelihood, observation, jnp.array(part), at)
    references, exact = full_references(likelihood)[:, 0], []
    for p, (x, y, theta) in zip(part, poses, strict=True):
        turned = (columns - x + 1j * (rows - y)) * np.exp(-1j * theta)
        width, height = scene.sizes[p]
        inside = (np.abs(turned.real) < width / 2) & (np.abs(turned.imag) < height / 2)
        share = np.bincount(bins[inside], minlength=NUM_BINS) / inside.sum()
        exact.append(1 - np.sqrt(share * references[p]).sum())
    for samples, bias, deviation in (
        (8, 0.03, 0.027), (10, 0.018, 0.018), (12, 0.015, 0.016), (16, 0.006, 0.011)
    ):  # fmt: skip
        error = distance[samples] - np.array(exact)
        print(f"{samples} samples per side: bias {error.mean():.4f}, deviation {error.std():.4f}")
        assert abs(error.mean()) < bias
        assert error.std() < deviation


def test_rotation_is_clockwise_in_the_image():
    # A box of red over blue, turned clockwise by a right angle: red is then on the right.
    patch = np.zeros((16, 16, 3), np.uint8)
    patch[:8, :, 0], patch[8:, :, 2] = 255, 255
    likelihood = histogram_from_patches([patch], method="sampled")
    frame = np.zeros((40, 40, 3), np.uint8)
    frame[:, 20:, 0], frame[:, :20, 2] = 255, 255
    observation = observe(likelihood, frame)
    right = log_prob(likelihood, observation, 0, jnp.array([20.0, 20.0, 1.0, np.pi / 2]))
    wrong = log_prob(likelihood, observation, 0, jnp.array([20.0, 20.0, 1.0, -np.pi / 2]))
    np.testing.assert_allclose([right, wrong], [0, -20 * 2], atol=1e-4)


@pytest.mark.parametrize("method", ["integral", "sampled"])
@pytest.mark.parametrize("parts", [1, 2, 3])
def test_one_particle_agrees_with_all(method, parts, boxes, substates):
    frame = noise(9)
    likelihood = histogram(frame, boxes, method=method, parts=parts)
    observation = observe(likelihood, frame)
    partition, at = jnp.arange(40) % len(boxes), jnp.array(substates[:, :40], jnp.float32)
    every = log_prob_all(likelihood, observation, partition, at)
    each = [log_prob(likelihood, observation, partition[n], at[:, n]) for n in range(40)]
    mapped = jax.jit(jax.vmap(likelihood.log_prob, in_axes=(None, 0, 1)))(
        observation, partition, at
    )
    np.testing.assert_allclose(every, each, rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(every, mapped, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("method", ["integral", "sampled"])
def test_runs_and_grids_of_parameters_map(method, boxes, substates):
    frame = noise()
    likelihood = histogram(frame, boxes, method=method)
    partition = jnp.arange(30) % len(boxes)
    at = jnp.array(substates.reshape(3, 10, 30).swapaxes(0, 1), jnp.float32)
    shapes = []

    def step(substates, frame):
        observation = observe(likelihood, frame)
        shapes.append(jax.tree.leaves(observation)[0].shape)
        return log_prob_all(likelihood, observation, partition, substates)

    text = str(jax.make_jaxpr(jax.vmap(step, in_axes=(0, None)))(at, frame))
    rows, columns = shapes[0][:2]
    assert f"[10,{rows},{columns}" not in text, "the observation was repeated for every run"
    got = jax.jit(jax.vmap(step, in_axes=(0, None)))(at, frame)
    np.testing.assert_allclose(got[4], step(at[4], frame), atol=1e-5)

    def with_sharpness(sharpness):
        changed = HistogramLikelihood(
            sharpness, likelihood.references, likelihood.sizes, likelihood.bin_lookup, method
        )
        return log_prob_all(changed, observe(changed, frame), partition, at[0])

    grid = jax.vmap(with_sharpness)(jnp.array([20.0, 40.0]))
    np.testing.assert_allclose(grid[1], 2 * grid[0], rtol=1e-5)


@pytest.mark.parametrize("method", ["integral", "sampled"])
def test_non_finite_substates_give_nan_and_tiny_boxes_minus_infinity(method, boxes):
    likelihood = histogram(noise(), boxes, method=method)
    observation = observe(likelihood, noise())
    nan, inf = np.nan, np.inf
    at = jnp.array(
        [[nan, 20, 20, inf, 20, 20, 20, 20], [20, nan, 20, 20, -inf, 20, 20, 20],
         [1, 1, nan, 1, 1, 0, -1, 0.05]]
    )  # fmt: skip
    got = np.asarray(log_prob_all(likelihood, observation, jnp.zeros(8, jnp.int32), at))
    assert np.isnan(got[:5]).all()
    assert np.isneginf(got[5:]).all()


@pytest.mark.parametrize("method", ["integral", "sampled"])
def test_gradients_are_finite_even_where_the_value_is_not(method, boxes):
    likelihood = histogram(noise(), boxes, method=method)
    observation = observe(likelihood, noise())
    at = jnp.array([[20.0, -500, 20, 3], [20.0, 20, 20, 3], [1.0, 1, 0, 1]])

    def total(likelihood, at):
        log_prob = log_prob_all(likelihood, observation, jnp.array([0, 1, 2, 1]), at)
        return jnp.sum(jnp.where(jnp.isfinite(log_prob), log_prob, 0))

    by_likelihood, by_substate = jax.grad(total, (0, 1), allow_int=True)(likelihood, at)
    assert np.isfinite(by_substate).all()
    for name in ("sharpness", "references", "sizes"):
        assert np.isfinite(getattr(by_likelihood, name)).all(), name
    expected = total(likelihood, at) / likelihood.sharpness
    np.testing.assert_allclose(by_likelihood.sharpness, expected, rtol=1e-5)
    alone = jax.grad(lambda s: log_prob(likelihood, observation, 0, s).sum())
    assert np.isfinite(alone(jnp.array([20.0, 20.0, 0.0]))).all()


@pytest.mark.parametrize("method", ["integral", "sampled"])
def test_the_result_has_the_dtype_of_the_substates_under_x64(method, boxes, substates):
    single = histogram(noise(), boxes, method=method)
    partition = jnp.zeros(40, jnp.int32)
    at = np.asarray(substates[:, :40])
    expected = log_prob_all(single, observe(single, noise()), partition, jnp.array(at, jnp.float32))
    assert expected.dtype == jnp.float32
    with jax.enable_x64(True):
        double = histogram(noise(), boxes, method=method)
        observation = observe(double, jnp.array(noise()))
        for dtype in (jnp.float32, jnp.float64):
            got = log_prob_all(double, observation, partition, jnp.array(at, dtype))
            assert got.dtype == dtype
            np.testing.assert_allclose(got, expected, atol=1e-4)


def test_references_learned_from_patches(boxes):
    frame = noise()
    patches = [frame[int(y) : int(y + h), int(x) : int(x + w)] for x, y, w, h in boxes]
    from_boxes = histogram(frame, boxes)
    from_patches = histogram_from_patches(patches, boxes[:, 2:])
    np.testing.assert_array_equal(from_boxes.references, from_patches.references)
    np.testing.assert_array_equal(from_boxes.sizes, histogram_from_patches(patches).sizes)
    swapped = histogram(frame, boxes, references={0: patches[1]})
    np.testing.assert_allclose(
        full_references(swapped)[0], full_references(from_boxes)[1], atol=1e-6
    )


def test_only_used_bins_have_a_table():
    frame = np.full((HEIGHT, WIDTH, 3), (255, 0, 0), np.uint8)
    likelihood = histogram(frame, [[10, 10, 20, 20]], method="integral")
    assert likelihood.references.shape[-1] == 16
    assert observe(likelihood, noise()).cells.shape == (HEIGHT + 1, WIDTH + 1, 16)


def test_the_cheaper_method_is_chosen_and_can_be_overridden():
    frame = noise(0, 288, 360)
    box = [[100, 100, 32, 42]]
    assert histogram(frame, box, num_particles=300, num_runs=1).method == "sampled"
    assert histogram(frame, box, num_particles=300, num_runs=500).method == "integral"
    assert histogram(frame, box, num_runs=500, method="sampled").method == "sampled"
    few = estimated_costs(num_pixels=100_000, num_bins=64, num_runs=1)
    many = estimated_costs(num_pixels=100_000, num_bins=64, num_runs=1000)
    assert few["sampled"] < few["integral"]
    assert many["sampled"] > many["integral"]


GOOD = [[10, 10, 16, 16]]


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: histogram(noise(), [[10, 10, 0, 16]]), r"boxes\[0\].*0\.0 pixels wide"),
        (lambda: histogram(noise(), [*GOOD, [10, 10, 16, np.nan]]), r"boxes\[1\].*finite"),
        (lambda: histogram(noise(), [[np.nan, 10, 16, 16]]), r"boxes\[0\].*finite"),
        (lambda: histogram(noise(), [[500, 10, 16, 16]]), r"boxes\[0\].*no pixel inside"),
        (lambda: histogram(noise(), [[10, -12, 16, 16]]), "part 0 of 2 has no pixel"),
        (lambda: histogram(noise(), [10, 10, 16, 16]), r"boxes has shape \[4\]"),
        (lambda: histogram(noise() / 255, GOOD), r"frame is float64 \[60, 80, 3\].*uint8"),
        (lambda: histogram(noise()[..., 0], GOOD), r"frame is uint8 \[60, 80\]"),
        (lambda: histogram(None, GOOD), "frame is NoneType"),
        (lambda: histogram(noise(), GOOD, method="fast"), "'auto', 'integral', 'sampled'"),
        (lambda: histogram(noise(), GOOD, sharpness=0.0), "sharpness is 0.0"),
        (lambda: histogram(noise(), GOOD, sharpness=np.inf), "sharpness is inf"),
        (lambda: histogram(noise(), GOOD, parts=0), "parts is 0"),
        (lambda: histogram(noise(), GOOD, parts=20), "20 of height"),
        (lambda: histogram(noise(), GOOD, samples=1), "samples is 1"),
        (lambda: histogram(noise(), GOOD, samples=1000), "samples is 1000: use at most 500"),
        (lambda: histogram(noise(), GOOD, num_runs=0), "num_runs is 0"),
        (lambda: histogram(noise(), GOOD, num_particles=-3), "num_particles is -3"),
        (lambda: histogram(noise(), GOOD, references={3: noise()}), "object 3"),
        (lambda: histogram(noise(), GOOD, references={0: noise()[:1]}), "1 pixels high"),
        (lambda: histogram_from_patches([]), "patches is empty"),
        (lambda: histogram_from_patches([noise() * 1.0]), r"patches\[0\] is float64"),
        (lambda: histogram_from_patches([noise()], [[4, 4, 4]]), "sizes has shape"),
        (lambda: histogram_from_patches([noise()], [[4, 0]]), r"sizes\[0\]"),
        (
            lambda: histogram(noise(), GOOD, method="integral").log_prob(
                jnp.zeros((61, 81, 16), jnp.uint16), 0, jnp.ones(4)
            ),
            "method='sampled'",
        ),
        (lambda: histogram(noise(), GOOD).observe(noise() / 2), "frame is float64"),
    ],
)
def test_every_mistake_has_one_clear_sentence(call, words):
    with pytest.raises(InputError, match=words):
        call()
