"""Learned appearance in windows around the objects: the results of whole frames."""

import dataclasses
import functools

import jax
import numpy as np
import pytest
from histograms import texture

import jaxpf
from jaxpf import pytree_dataclass
from jaxpf.boxes.models import DEFAULT_STEPS, box_model
from jaxpf.likelihoods import discriminative
from jaxpf.likelihoods.discriminative.likelihood import DiscriminativeLikelihood
from jaxpf.likelihoods.discriminative.nearby import WindowShape

HEIGHT, WIDTH = 241, 323  # odd, so that the shrunk frame is filled up
#: The second object is shrunk by 2.
BOXES = np.array([[100.0, 80.0, 12.0, 12.0], [200.0, 120.0, 44.0, 40.0]])
SHAPE = WindowShape(rows=64, columns=80, height=30, width=33)
_WHOLE = jax.jit(DiscriminativeLikelihood.observe)
_NEARBY = jax.jit(DiscriminativeLikelihood.observe_nearby)
_LOG_PROBS = jax.jit(DiscriminativeLikelihood.log_prob_all)
_LOG_ODDS = jax.jit(DiscriminativeLikelihood.log_odds_all)


FRAME = texture(0, HEIGHT, WIDTH)


@pytest.fixture(scope="module")
def learned():
    likelihood = discriminative(FRAME, BOXES)
    return dataclasses.replace(likelihood, windows=SHAPE)


@pytest.mark.slow
@pytest.mark.always
@pytest.mark.parametrize(
    "centres",
    [
        [[106.0, 86.0], [222.0, 140.0]],
        [[3.0, 238.0], [320.0, 4.0]],  # in corners of the frame
        [[-20.0, 100.0], [330.0, 260.0]],  # outside
    ],
)
def test_a_box_has_the_likelihood_of_the_whole_frame_or_none(learned, centres):
    centres = np.array(centres, np.float32)
    estimates = np.column_stack([centres, np.ones(2)]).astype(np.float32)
    near, whole = _NEARBY(learned, FRAME, estimates), _WHOLE(learned, FRAME)
    rng, number = np.random.default_rng(1), np.repeat([0, 1], 2000)
    side = np.array([12.0, 42.0])[number]
    scale = np.exp(rng.normal(0, 0.3, 4000))
    places = centres[number].T + side * rng.normal(0, 1.2, (2, 4000))
    substates = np.stack([*places, scale]).astype(np.float32)
    in_window, in_frame = (
        np.asarray(_LOG_PROBS(learned, seen, number, substates)) for seen in (near, whole)
    )
    shown = ~np.isnan(in_window)
    np.testing.assert_allclose(in_window[shown], in_frame[shown], rtol=1e-5, atol=1e-5)
    # A box that lies in the window is shown, one that leaves it is not.
    reach = np.array(SHAPE[1::-1]) * np.array([[1], [2]]) / 2  # window's half size in the frame
    extent = scale * BOXES[number, 2:].T / 2
    corner = np.clip(places - extent, 0, [[WIDTH], [HEIGHT]])
    end = np.clip(places + extent, 0, [[WIDTH], [HEIGHT]])
    away = np.maximum(centres[number].T - corner, end - centres[number].T) - reach[number].T
    small = np.all(2 * extent <= (np.array([1, 2])[number] * np.array([[33.0], [30.0]])), axis=0)
    assert shown[small & np.all(away < -6, axis=0)].all()
    assert not shown[~small | np.any(away > 6, axis=0)].any()
    assert 0.05 < shown.mean() < 0.99


@pytest.mark.slow
@pytest.mark.parametrize("scale", [pytest.param(0.6, marks=pytest.mark.always), 1.0, 1.45])
def test_log_odds_compare_with_the_same_places_elsewhere(learned, scale):
    substates = np.column_stack([BOXES[:, :2] + BOXES[:, 2:] / 2, [scale] * 2])
    substates = substates.T.astype(np.float32)
    near = _NEARBY(learned, FRAME, substates.T)
    # The objects are gone, and a copy of the second stands where the grid has a place.
    moved, (x, y, w, h) = texture(5, HEIGHT, WIDTH), BOXES[1].astype(int)
    left, top = round(2.5 * WIDTH / 12) - w // 2, round(2.5 * HEIGHT / 12) - h // 2
    moved[top : top + h, left : left + w] = FRAME[y : y + h, x : x + w]
    for frame in (FRAME, moved):
        odds = [
            np.asarray(_LOG_ODDS(learned, seen, np.arange(2), substates))
            for seen in (_NEARBY(learned, frame, substates.T), _WHOLE(learned, frame))
        ]
        np.testing.assert_allclose(*odds, atol=1e-4)
    assert np.isfinite(near.elsewhere[1]).all()


SIDE, HIDDEN, FRAMES = 12, 9, 16


@pytree_dataclass
class Sighted(DiscriminativeLikelihood):
    """Sees a whole frame times ``sight``: 0 sees nothing in it; data, so both are one program."""

    sight: np.uint8 = np.uint8(1)

    def observe(self, frame):
        return super().observe(frame * self.sight)


@functools.cache
def scene():
    """Frames of two moving objects, which vanish at frame ``HIDDEN``; boxes ``[2, 4]``."""
    frames = []
    for time in range(FRAMES):
        frame = texture(0, HEIGHT, WIDTH)
        for number, (x, y) in enumerate([(60 + 3 * time, 50 + time), (200 - time, 150)]):
            if time < HIDDEN:
                frame[y : y + SIDE, x : x + SIDE] = texture(7 + number, SIDE, SIDE)
        frames.append(frame)
    return np.stack(frames), np.array([[60.0, 50, SIDE, SIDE], [200.0, 150, SIDE, SIDE]])


@pytest.mark.slow
def test_a_run_sees_whole_frames_only_where_particles_leave_the_windows():
    frames, boxes = scene()
    learned = discriminative(frames[0], boxes, reach=1.2)
    assert learned.windows is not None
    whole = dataclasses.replace(learned, windows=None)
    seeing, blind = (Sighted(**vars(learned), sight=np.uint8(sight)) for sight in (1, 0))

    def run(likelihood, stride):
        """With steps ``stride`` times as long."""
        steps = np.array(DEFAULT_STEPS) * [stride, stride, 1]
        tracker = jaxpf.Partitioned(
            **box_model(likelihood, boxes, steps=steps)._asdict(),
            ordering=jaxpf.ordering.dps(2),
            num_particles=100,
        )
        return jaxpf.run(tracker, jax.random.key(3), frames[1:])[1]

    for stride in (1, 8):
        of_windows, of_frames, unseeing = (run(x, stride) for x in (seeing, whole, blind))
        followed = slice(HIDDEN - 1 if stride == 1 else 0)
        for name in ("estimate", "log_evidence", "spread", "ess", "confidence"):
            expected = getattr(of_frames, name)
            for summary, part in ((of_windows, slice(None)), (unseeing, followed)):
                found = getattr(summary, name)
                np.testing.assert_allclose(found[part], expected[part], rtol=1e-4, atol=1e-4)
        np.testing.assert_array_equal(of_windows.num_invalid, 0)
        assert (of_frames.confidence[followed] > 0.5).all()
    assert np.abs(unseeing.estimate - of_frames.estimate).max() > 1


@pytest.mark.slow
@pytest.mark.always
def test_windows_that_save_little_are_not_used():
    frames, boxes = scene()
    assert discriminative(frames[0], boxes, reach=12.0).windows is None
    assert discriminative(frames[0], boxes).windows is None
