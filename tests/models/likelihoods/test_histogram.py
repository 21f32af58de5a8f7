"""Colour-histogram likelihood: exact against brute force, and honest about its limits."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from histograms import (
    HEIGHT,
    WIDTH,
    brute_log_prob,
    full_references,
    log_prob,
    log_prob_all,
    noise,
    observe,
)

from jaxpf.errors import InputError
from jaxpf.models.likelihoods.histogram import (
    HistogramLikelihood,
    estimated_costs,
    histogram,
    histogram_from_patches,
)


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
