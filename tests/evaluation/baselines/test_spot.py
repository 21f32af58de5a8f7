"""SPOT and optical flow on pictures whose motion is known."""

import dataclasses

import numpy as np
import pytest

import jaxpf
import scenes
from jaxpf.evaluation import Plan, evaluate
from jaxpf.evaluation.baselines import spot as module
from jaxpf.evaluation.baselines.optical_flow import follow_points
from jaxpf.evaluation.baselines.rivals import baselines
from jaxpf.evaluation.baselines.spot import Options, hog, spot

RNG = np.random.default_rng(0)
PICTURE = np.kron(RNG.integers(0, 256, (20, 26, 3), dtype=np.uint8), np.ones((6, 6, 1), np.uint8))
POINTS = np.array([[40.5, 40.5], [70.5, 45.5], [55.5, 75.5]])
FRAMES = [np.roll(PICTURE, (t, 2 * t), axis=(0, 1)) for t in range(7)]
TRUTH = POINTS + np.arange(1, 7)[:, None, None] * np.array([2.0, 1.0])


def test_optical_flow_follows_points_and_says_when_it_does_not():
    places, followed = follow_points(FRAMES, POINTS)
    assert followed.all()
    np.testing.assert_allclose(places, TRUTH, atol=0.1)
    places, followed = follow_points([*FRAMES[:3], np.zeros_like(PICTURE)], POINTS)
    assert not followed[-1].any()
    np.testing.assert_array_equal(places[-1], places[-2])


def test_spot_follows_points_within_a_cell():
    assert np.abs(spot(FRAMES, POINTS) - TRUTH).max() <= 4


def test_spot_finds_a_covered_part_by_its_springs():
    covered = [frame.copy() for frame in FRAMES]
    for t, frame in enumerate(covered[2:], start=2):
        x, y = (POINTS[1] + np.array([2.0, 1.0]) * t).astype(int)
        frame[y - 14 : y + 15, x - 14 : x + 15] = 128
    places = spot(covered, POINTS, Options(stiffness=0.1))
    assert np.abs(places[-1, 1] - TRUTH[-1, 1]).max() <= 8


def test_spot_finds_the_best_of_all_configurations():
    """Against trying them all, on a frame of few cells."""
    picture, points = PICTURE[:32, :36], np.array([[14.0, 14.0], [22.0, 14.0]])
    frames = [picture, np.roll(picture, 4, axis=1)]
    options = Options(size=3, aggressiveness=0.0, stiffness=0.5)
    (places,) = spot(frames, points, options)
    model = module._Model(module._padded(hog(frames[0], 4), 3), points, options)
    maps = module._responses(module._padded(hog(frames[1], 4), 3), model.templates)
    rows, columns = maps.shape[1:]
    cells = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), -1).reshape(-1, 2)
    apart = cells[:, None] - cells[None]
    root, child = model.order
    flat = maps.reshape(2, -1)
    total = flat[child][:, None] + flat[root][None]
    total = total - 0.5 * ((apart - np.round(model.springs[child])) ** 2).sum(-1)
    best_child, best_root = np.unravel_index(np.argmax(total), total.shape)
    expected = 4 * (cells[[best_child, best_root]] + 0.5) + model.rest[[child, root]]
    np.testing.assert_allclose(places[[child, root]], expected)


def test_spot_is_a_baseline_of_points_and_others_are_refused(tmp_path):
    scene = scenes.make("fish", num_frames=4, frame_width=480, frame_height=270)
    truth, found = scene.extras["points"], {}
    for name, nearest in (("spot", 8), ("flow", 4)):
        places = found[name] = baselines([name])[name](scene)
        assert places.shape == truth.shape
        np.testing.assert_array_equal(places[0], truth[0])
        assert np.median(np.linalg.norm(places[-1] - truth[-1], axis=-1)) < nearest
    plan = Plan(scene=scene, methods=[], trackers=baselines(["spot"]), runs=1)
    results = evaluate(plan, tmp_path / "points")
    (batch,) = results.batches(results.configurations[0])
    np.testing.assert_allclose(batch.shapes[0], found["spot"][1:], rtol=1e-6)
    still = dataclasses.replace(plan, trackers=baselines(["still"]))
    with pytest.raises(jaxpf.InputError, match=r"'still' gives boxes, but .* are points"):
        evaluate(still, tmp_path / "boxes")
    with pytest.raises(jaxpf.InputError, match="'spot' tracks points, and 'street' has none"):
        baselines(["spot"])["spot"](scenes.street_scene(3))


def test_gradients_are_counted_by_their_direction():
    ramp = np.zeros((16, 16, 3), np.uint8)
    ramp[:, 8:] = 255
    features = hog(ramp, 4)
    assert features.shape == (4, 4, 36)
    assert features[1, 1, :9].argmax() in (0, 8)  # across: the two bins that meet at no angle
    assert not features[:, 0].any()


def test_spot_refuses_bad_input():
    with pytest.raises(jaxpf.InputError, match="outside the frame"):
        spot(FRAMES, [[900, 3]])
