"""Three opaque contours on drawn pictures: what is hidden, by whom, and what an edge pays."""

from itertools import permutations

import cv2
import jax
import numpy as np
import pytest

from jaxpf.likelihoods import EdgeDetector, contours
from jaxpf.likelihoods.contours import exclusive
from jaxpf.likelihoods.contours.exclusive import OpaqueContours
from jaxpf.shapes import space_of
from jaxpf.shapes.depth import depth_orders

HEIGHT, WIDTH = 160, 240
MIDDLES = np.array([(60, 80), (120, 80), (180, 80)])
LABELS = np.arange(6)


def square(x, y, half):
    corners = np.array([(-1, -1), (0, -1), (1, -1), (1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0)])
    return half * corners + np.array([x, y])


def picture(bodies):
    """Bodies ``(x, y, half, grey)``, the farthest first."""
    frame = np.full((HEIGHT, WIDTH, 3), 210, np.uint8)
    for x, y, half, grey in bodies:
        frame[y - half : y + half, x - half : x + half] = grey
    return frame


SPACE = space_of("similarity", np.stack([square(*place, 20.0) for place in MIDDLES]), degree=1)
FRAME = picture([(180, 80, 20, 150), (120, 80, 20, 100), (60, 80, 20, 60)])


def likelihood(exclusion="opaque", num_targets=3):
    templates = np.stack([square(*place, 20.0) for place in MIDDLES[:num_targets]])
    space = space_of("similarity", templates, degree=1)
    detector = EdgeDetector(length=41)
    return contours(
        space, num_targets, exclusion=exclusion, clutter=0.5, detector=detector, num_lines=16
    )


THREE = likelihood()


def bodies_at(*bodies):
    """Substates ``[P, D, 6]`` of squares ``(x, y, half)``, one column for each label."""
    space = SPACE if len(bodies) == 3 else likelihood(num_targets=len(bodies)).space
    found = np.asarray(space.project(np.stack([square(*body) for body in bodies])))
    return np.repeat(found[..., None], 6, axis=-1).astype(np.float32)


@jax.jit
def by_label(likelihood, substates, labels=LABELS):
    return likelihood.log_joint_labelled_all(likelihood.observe(FRAME), substates, None, labels)


def check_what_is_hidden():
    """Own boundaries, beside what OpenCV finds inside the outlines that a label says are nearer."""
    rng, seen = np.random.default_rng(0), 0
    observation = jax.jit(THREE.observe)(FRAME)

    @jax.jit
    def crossed(substates):
        lines = THREE.lines_of_all(substates)
        return lines, THREE.all_crossings(observation, lines, LABELS)[1]

    for _ in range(6):
        substates = bodies_at(
            *np.column_stack([rng.uniform(60, 110, (3, 2)), rng.uniform(15, 35, 3)])
        )
        lines, there = crossed(substates)
        x, y = np.asarray(lines.x)[..., 0], np.asarray(lines.y)[..., 0]  # [M, P]
        outlines = np.stack([x, y], axis=-1).astype(np.float32)
        for label, order in enumerate(permutations(range(3))):
            for depth, target in enumerate(order):
                inside = [
                    any(
                        cv2.pointPolygonTest(outlines[:, nearer][:, None], point, False) > 0
                        for nearer in order[:depth]
                    )
                    for point in outlines[:, target].tolist()
                ]
                np.testing.assert_array_equal(
                    np.asarray(there)[0, :, target, label], ~np.array(inside)
                )
                seen += sum(inside)
    assert seen > 100


def test_hidden_is_what_lies_inside_a_nearer_outline():
    check_what_is_hidden()


@pytest.mark.slow
@pytest.mark.parametrize("mutation", ["who hides is hidden", "only the nearest hides"])
def test_kills_what_is_hidden_by_the_wrong_target(monkeypatch, mutation):
    def wrong(num_targets):
        depth = np.argsort(depth_orders(num_targets), axis=1)
        return num_targets - 1 - depth if mutation.startswith("who") else np.minimum(depth, 1)

    monkeypatch.setattr(exclusive, "depths", wrong)
    with pytest.raises(AssertionError):
        check_what_is_hidden()


@pytest.mark.slow
def test_one_edge_pays_once_also_of_three():
    """What is hidden behind the first earns nothing of its edge, and takes nothing."""
    truth, hidden = (*MIDDLES[2], 20.0), (*MIDDLES[0], 14.0)
    both = (*MIDDLES[0], 20.0), (*MIDDLES[1], 20.0)
    of_two = float(by_label(likelihood(num_targets=2), bodies_at(*both), np.zeros(6, int))[0])
    is_behind = [order.index(0) < order.index(2) for order in depth_orders(3)]
    found = np.asarray(by_label(THREE, bodies_at(*both, hidden)))
    np.testing.assert_allclose(found[is_behind], of_two, rtol=1e-5)
    assert by_label(THREE, bodies_at(*both, truth))[0] - of_two > 10
    # Each line by itself, as eq. 5 is printed: the first's edge is paid for once more.
    literal = likelihood("opaque-literal")
    paid_twice = np.asarray(by_label(literal, bodies_at(*both, hidden)))[is_behind]
    assert (paid_twice - of_two > 10).all()


def test_overlap_is_asked_of_any_two():
    substates = bodies_at((60, 80, 20.0), (90, 80, 20.0), (150, 80, 20.0))[..., 0]
    overlap = jax.jit(OpaqueContours.overlap)
    found = [bool(overlap(THREE, substates, *pair)) for pair in ((0, 1), (1, 0), (0, 2), (1, 2))]
    assert found == [True, True, False, False]
    assert bool(THREE.overlap(substates)) == found[0]
