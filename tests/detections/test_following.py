"""Boxes that come and go, from pictures and detections to tracks."""

import jax
import numpy as np
import pytest

import jaxpf
from jaxpf.boxes.target import BOXES
from jaxpf.detections import Rules, follow, open_box_tracker
from jaxpf.detections.lifetimes import EMPTY

COLOURS = ((220, 30, 30), (30, 40, 220), (30, 180, 40))
LENGTH, SHAPE = 16, (48, 64)
#: Object -> frames in which it is there: the second goes, the third comes in its place.
THERE = (range(16), range(7), range(8, 16))
SETTINGS = {"min_hits": 2, "max_age": 1, "detection_iou": 0.3}
RULES = Rules(**SETTINGS)


def true_box(number, time):
    return np.array([[4.0 + 2 * time, 6], [44 - time, 26], [20 + time, 26]][number] + [12.0, 16.0])


@pytest.fixture(scope="module")
def clip():
    """Frames with up to three rectangles, and detections of them, one of which is false."""
    rng = np.random.default_rng(0)
    frames, detections = [], []
    for time in range(LENGTH):
        frame = rng.integers(90, 130, (*SHAPE, 3), dtype=np.uint8)
        found = [true_box(number, time) for number in range(3) if time in THERE[number]]
        for number in (number for number in range(3) if time in THERE[number]):
            x, y, w, h = true_box(number, time).astype(int)
            frame[y : y + h, x : x + w] = COLOURS[number]
        frames.append(frame)
        detections.append(np.array(found + [[1.0, 30, 12, 16]] * (time == 5)))
    return frames, detections


def tracked(clip, capacity=3, detections="all", **settings):
    frames, found = clip
    tracker = open_box_tracker(
        SHAPE,
        capacity=capacity,
        num_particles=240,
        typical_size=(12, 16),
        noise_pixels=(3, 2, 0.003),
    )
    found = found if isinstance(detections, str) else detections
    given = {"rules": RULES, "detections": found} | settings
    return [Objects(record) for record in follow(tracker, jax.random.key(0), frames, **given)]


class Objects:
    """A record of one labelled tracker, in its slots."""

    def __init__(self, record):
        (group,) = record.groups
        self.time, self.changes, self.group = record.number, record.changes, group
        self.ids, self.boxes = group.start.ids, group.shapes


def starts(*rows):
    """Starts by frame, of rows of a frame, an id and a box."""
    frames = dict.fromkeys(frame for frame, *_ in rows)
    return {
        at: BOXES.start(
            np.array([box for frame, _, box in rows if frame == at]),
            [identity for frame, identity, _ in rows if frame == at],
        )
        for at in frames
    }


@pytest.mark.parametrize("scale", [pytest.param(0.0, marks=pytest.mark.slow), 0.1])
def test_each_object_has_one_track_as_long_as_it_is_there(clip, scale):
    run = tracked(clip, rules=Rules(**SETTINGS, detection_noise=scale))
    started = {new.id: one.time for one in run for new in one.changes.started}
    assert started == {1: 1, 2: 1, 3: 9}
    (end,) = [(one.time, gone.id) for one in run for gone in one.changes.ended]
    assert end == (8, 2)
    for one in run:
        for number, time_born in enumerate(started.values()):
            slot = np.flatnonzero(one.ids == number + 1)
            if time_born <= one.time and one.time in THERE[number]:
                off = one.boxes[slot[0]] - true_box(number, one.time)
                assert np.abs(off).max() < 3, (one.time, number)
        assert np.isnan(one.boxes[one.ids == EMPTY]).all()
    # The third has the slot of the second, and an id of its own.
    slots = {new.id: new.slot for one in run for new in one.changes.started}
    assert slots[3] == slots[2]


def test_whoever_comes_and_goes_nothing_is_compiled_anew(clip, caplog):
    rules = {"min_hits": 1, "max_age": 2, "detection_iou": 0.2}
    assert compiled(caplog, lambda: jax.jit(lambda x: x + len(rules))(1.0))
    tracked(clip)
    assert compiled(caplog, lambda: tracked(clip, rules=Rules(**rules))) == []


def compiled(caplog, function):
    """What JAX says that it compiles meanwhile."""
    caplog.clear()
    with jax.log_compiles():
        function()
    return [record.message for record in caplog.records if "Compiling" in record.message]


def test_a_users_boxes_start_objects_in_any_frame_without_a_detector(clip):
    named = starts((0, 5, true_box(0, 0)), (10, 9, true_box(2, 10)))
    run = tracked(clip, detections=None, start=named.pop(0), later=named)
    assert run[9].ids.tolist() == [5, EMPTY, EMPTY]
    assert run[-1].ids.tolist() == [5, 9, EMPTY]
    np.testing.assert_array_equal(run[10].boxes[1], true_box(2, 10))
    for slot, number in ((0, 0), (1, 2)):
        assert np.abs(run[-1].boxes[slot] - true_box(number, LENGTH - 1)).max() < 3


def test_what_cannot_start_in_the_first_frame_is_an_error_and_later_a_note(clip):
    below = np.array([20.0, 41, 12, 16])  # its lower band lies outside
    with pytest.raises(jaxpf.InputError, match="object 4 at 20,41,12,16 cannot start"):
        tracked(clip, start=starts((0, 4, below))[0])
    run = tracked(clip, later=starts((3, 4, below)))
    (refusal,) = run[3].changes.refused
    assert refusal.id == 4
    assert "no pixel inside" in refusal.reason
    assert 4 not in run[-1].ids
    crowd = [(0, identity, true_box(0, 0)) for identity in range(4)]
    with pytest.raises(jaxpf.InputError, match=r"object 3 at .* capacity"):
        tracked(clip, start=starts(*crowd)[0])


@pytest.mark.slow
def test_who_fits_nothing_is_an_error_in_the_first_frame_and_lost_later(clip):
    """Boxes of less than a pixel have no likelihood: noise of the size makes them so."""
    frames, detections = clip
    wild = open_box_tracker(SHAPE, capacity=1, num_particles=1, noise_pixels=(1, 1, 1000.0))
    keys = [jax.random.key(seed) for seed in range(8)]
    rules = Rules(min_hits=1, detection_noise=0.0)
    given = {"detections": detections, "rules": rules}
    ran = [list(follow(wild, key, frames[:2], **given)) for key in keys]
    lost = [bool(run[1].groups[0].without_likelihood.any()) for run in ran]
    assert 0 < sum(lost) < 8
    named = {"start": starts((0, 3, true_box(0, 0)))[0], "rules": Rules()}
    with pytest.raises(jaxpf.InputError, match="every particle of target 3 has likelihood zero"):
        list(follow(wild, keys[lost.index(True)], frames[:2], **named))
    assert len(list(follow(wild, keys[lost.index(False)], frames[:2], **named))) == 2


def test_a_detection_of_which_nothing_can_be_learned_waits(clip):
    """At once, in the first frame: it is too small to learn from, and larger in the next."""
    frames, _ = clip
    speck = np.array([[10.0, 12.0, 0.5, 0.5]])
    run = tracked(
        clip,
        detections=[speck, *(true_box(0, t)[None] for t in range(1, LENGTH))],
        rules=Rules(min_hits=1),
    )
    assert [new.box.tolist() for new in run[1].changes.started] == [true_box(0, 1).tolist()]
    assert [refusal.id for refusal in run[0].changes.refused] == [EMPTY]
    assert len(run) == len(frames)
