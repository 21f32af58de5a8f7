"""An object that was hidden and comes out elsewhere: lost for good, or found again."""

import functools

import jax
import numpy as np
import pytest
from histograms import texture

import jaxpf
from jaxpf import ordering
from jaxpf.boxes import relative_box_model
from jaxpf.filters import relocation_in
from jaxpf.likelihoods import discriminative

HEIGHT, WIDTH, SIDE, RUNS = 96, 160, 24, 20
#: Frames in which the first object is hidden; before and after it stands elsewhere.
HIDDEN = range(5, 10)
FRAMES = 18


def places(time):
    """Left and top of both objects: the first walks off behind the scenes, the second stays."""
    first = (12 + 2 * time, 8 + time) if time < HIDDEN.start else (150 - 2 * time, 60)
    return first, (20, 64)


@functools.cache
def scene():
    """Frames, and true boxes ``[T, 2, 4]``."""
    frames, boxes = [], []
    for time in range(FRAMES):
        frame = texture(0, HEIGHT, WIDTH)
        for number, (x, y) in enumerate(places(time)):
            if number or time not in HIDDEN:
                frame[y : y + SIDE, x : x + SIDE] = texture(7 + number, SIDE, SIDE)
        frames.append(frame)
        boxes.append([[x, y, SIDE, SIDE] for x, y in places(time)])
    return np.stack(frames), np.array(boxes, float)


def report(state, summary):
    return summary.estimate, summary.confidence


@functools.cache
def followed(method, epsilon):
    """Overlaps and confidence ``[R, T - 1, 2]`` of many runs."""
    frames, boxes = scene()
    model = relative_box_model(discriminative(frames[0], boxes[0]), boxes[0])
    tracker = jaxpf.Partitioned(
        **model._asdict(),
        ordering={"ps": ordering.ps([0, 1]), "dps": ordering.dps(2)}[method],
        relocation=relocation_in((HEIGHT, WIDTH), np.float32(epsilon)),
        num_particles=200,
    )
    keys = jax.random.split(jax.random.key(0), RUNS)
    estimate, confidence = jaxpf.monte_carlo(tracker, keys, frames[1:], report, batch_size=RUNS)
    shapes = jaxpf.shapes.boxes_from_substates(estimate, boxes[0, :, 2:])
    return np.asarray(jaxpf.measures.iou(shapes, boxes[None, 1:])), np.asarray(confidence)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["ps", "dps"])
def test_who_comes_out_elsewhere_is_found_again(method):
    without, confidence = followed(method, 0.0)
    iou, again = followed(method, 0.05)
    before, after = HIDDEN.start - 1, slice(HIDDEN.stop + 4, None)
    np.testing.assert_array_equal(without[:, :before], iou[:, :before])
    assert (confidence[:, HIDDEN.stop - 2, 0] < 0.5).all()
    assert (without[:, after, 0] > 0.5).mean() < 0.1
    assert (iou[:, after, 0] > 0.5).mean() > 0.9
    assert (again[:, -1, 0] > 0.5).mean() > 0.9
    # Whoever was there all the time stays there.
    assert (iou[:, :, 1] > 0.5).mean() > 0.95
    assert (again[:, :, 1] > 0.5).mean() > 0.95
