"""Scenes of drawn contours: their truth lies on the drawn edges, they meet, pass and repeat."""

import numpy as np
import pytest

import scenes
from scenes.wires import Wires

NAMES = ("wires", "leaves", "walkers")
SMALL = {"num_frames": 21}


@pytest.fixture(scope="module")
def drawn():
    return {name: scenes.make(name, seed=3, **SMALL) for name in NAMES}


@pytest.mark.parametrize("name", NAMES)
def test_boxes_hold_the_outlines_and_begin_apart(drawn, name):
    scene = drawn[name]
    outlines, boxes = scene.extras["outlines"], scene.boxes
    assert outlines.shape[:2] == (21, 2)
    low, high = outlines.min(axis=2), outlines.max(axis=2)
    np.testing.assert_allclose(boxes, np.concatenate([low, high - low], axis=-1))
    gaps = boxes[:, 1, 0] - boxes[:, 0, 0] - boxes[:, 0, 2]
    assert abs(gaps[0]) > 0
    assert len(scene.patches) == 2


@pytest.mark.parametrize("name", ["leaves", "walkers"])
def test_a_closed_outline_parts_the_target_from_what_is_around_it(drawn, name):
    scene = drawn[name]
    grey = scene.frames[0].astype(float).mean(axis=-1)
    for outline in scene.extras["outlines"][0]:
        middle = outline.mean(axis=0)
        x, y = (middle + 0.5 * (outline - middle)).T.astype(int)
        inner = grey[y, x]
        x, y = (middle + 1.3 * (outline - middle)).T.astype(int)
        outer = grey[y.clip(0, 239), x.clip(0, 319)]
        assert inner.std() < 12
        assert abs(inner.mean() - np.median(outer)) > 25


def test_wires_are_dark_and_stay_together_in_the_middle(drawn):
    scene = drawn["wires"]
    grey = scene.frames[0].astype(float).mean(axis=-1)
    for wire in scene.extras["outlines"][0]:
        x, y = wire[5:-5].T.astype(int)
        assert grey[y, x].mean() < np.median(grey) - 50
    distance = np.linalg.norm(np.diff(scene.extras["outlines"], axis=1)[:, 0], axis=-1).mean(
        axis=-1
    )
    first, last = scene.extras["meeting"]
    assert last - first >= 10
    assert distance[first : last + 1].max() < 25 < distance[[0, -1]].min()


@pytest.mark.parametrize("seed", range(4))
def test_wires_move_smoothly_and_their_middles_never_pass(seed):
    paths, (first, last) = Wires().paths(np.random.default_rng(seed))
    steps = np.linalg.norm(np.diff(paths, axis=0), axis=-1).max(axis=(1, 2))
    assert steps.max() < 4.8
    # Where the meeting begins and ends no frame jumps beside its neighbours.
    assert np.abs(np.diff(steps))[first - 3 : last + 3].max() < 1
    middles = paths.mean(axis=2)[..., 0]
    assert (middles[:, 1] - middles[:, 0]).min() > 2


def test_one_leaf_passes_in_front_of_the_other(drawn):
    scene = drawn["leaves"]
    assert scene.extras["overlap"][[0, -1]].max() == 0
    assert scene.extras["overlap"].max() > 0.4
    front = scene.extras["front"][0]
    assert scene.extras["order"][0].tolist() == [front, 1 - front]
    farther_hidden = scene.extras["overlaps"][:, 1 - front, front]
    np.testing.assert_array_equal(scene.extras["overlap"], farther_hidden)
    middles = scene.extras["outlines"].mean(axis=2)[..., 0]
    assert (middles[0, 0] < middles[0, 1]) != (middles[-1, 0] < middles[-1, 1])


@pytest.mark.parametrize("count", [3, 4])
def test_several_leaves_pass_one_another_in_a_known_order(count):
    scene = scenes.make("leaves", seed=3, leaves=count, noise=0, leaf_texture=0, **SMALL)
    outlines, order = scene.extras["outlines"], scene.extras["order"]
    assert outlines.shape[:2] == order.shape == (21, count)
    assert sorted(order[0]) == list(range(count))
    assert (order == order[0]).all()
    np.testing.assert_array_equal(scene.extras["front"], order[:, 0])
    overlaps = scene.extras["overlaps"]
    np.testing.assert_array_equal(overlaps[:, range(count), range(count)], 1)
    apart = overlaps[0][~np.eye(count, dtype=bool)]
    assert apart.max() == 0
    pairs = [overlaps[:, i, j].max() for i in range(count) for j in range(i)]
    assert min(pairs) > 0.25
    # Where the nearest of all lies, its seam and its grey are seen whole.
    grey = scene.frames[10, ..., 0].astype(float)
    for depth, target in enumerate(order[0][:2]):
        outline = outlines[10, target]
        inner = outline.mean(axis=0) + 0.97 * (outline - outline.mean(axis=0))
        x, y = inner.T.astype(int)
        seen = np.mean(grey[y, x] < 165)
        assert seen > 0.8 if depth == 0 else seen < 0.8


def test_walkers_vary_as_their_examples_do(drawn):
    scene = drawn["walkers"]
    examples = scene.extras["examples"]
    assert examples.shape == (80, scene.extras["outlines"].shape[2], 2)
    flat = (examples - examples.mean(axis=1, keepdims=True)).reshape(len(examples), -1)
    _, components = np.linalg.svd(flat - flat.mean(axis=0), full_matrices=False)[1:]
    outlines = scene.extras["outlines"]
    bodies = (outlines - outlines.mean(axis=2, keepdims=True)).reshape(-1, flat.shape[1])
    bodies -= flat.mean(axis=0)
    left = bodies - bodies @ components[:6].T @ components[:6]
    assert np.abs(left).max() < 1e-6
