from itertools import pairwise

import cv2
import numpy as np
import pytest

from jaxpf.media import draw_boxes, draw_outlines, draw_particles, object_colours

BOX = np.array([[20.0, 30, 60, 45]])


def grey(width=120, height=90):
    return np.full((height, width, 3), 128, np.uint8)


def changed(before, after):
    return (before != after).any(axis=-1)


def test_a_box_is_drawn_on_the_pixels_it_covers():
    frame = grey()
    drawn = draw_boxes(frame, [[20.0, 30.0, 40.0, 25.0]], [7])
    # Columns 20 to 59 and rows 30 to 54 are covered.
    for row, column in ((54, 25), (40, 20), (40, 59), (30, 57)):
        np.testing.assert_array_equal(drawn[row, column], object_colours(1)[0])
    assert not changed(frame, drawn)[33:52, 23:56].any()
    assert (frame == 128).all(), "the given frame is left alone"


def test_a_lost_box_is_dashed_and_faint_and_a_doubtful_one_dashed_with_a_question_mark():
    lost = draw_boxes(grey(), BOX, [1], lost=[True])
    doubtful = draw_boxes(grey(), BOX, [1], doubtful=[True])
    # Half of what a doubtful box's line is; in the gaps between dashes there is nothing.
    np.testing.assert_allclose(lost[74], (doubtful[74].astype(float) + 128) / 2, atol=1)
    assert (lost[74, 20:80] == 128).all(-1).any()
    both = draw_boxes(grey(), BOX, [1], lost=[True], doubtful=[True])
    np.testing.assert_array_equal(both, lost)
    above = slice(0, 26)
    np.testing.assert_array_equal(doubtful[above], draw_boxes(grey(), BOX, ["1 ?"])[above])


def test_what_is_not_finite_is_skipped_and_labels_stay_inside_the_frame():
    frame = grey()
    for box in ([np.nan] * 4, [1, 2, np.inf, 4]):
        np.testing.assert_array_equal(draw_boxes(frame, [box], [1]), frame)
    for box in ([-30, -20, 60, 50], [110, 80, 50, 50], [1e9, 1e9, 1, 1], [-1e9, 0, 2e9, 5]):
        drawn = draw_boxes(frame, np.array([box], float), [3], lost=[True])
        assert drawn.shape == frame.shape
        assert changed(frame, drawn).any()


def test_names_are_no_wider_than_their_objects_and_do_not_cover_one_another():
    boxes = np.array([[50.0, 60, 80, 120], [60, 62, 80, 120]])
    drawn = draw_boxes(grey(640, 480), boxes, ["walker", "a long name"])
    for colour, (x, y, w, h) in zip(object_colours(2), boxes.astype(int), strict=True):
        rows, columns = np.nonzero((drawn == colour).all(axis=-1))
        assert columns.min() >= x - 1
        assert columns.max() <= x + w
        # Either above or below the box there is a tag.
        assert (rows < y - 3).any() or (rows > y + h + 3).any()


def test_names_of_tiny_objects_are_listed_in_a_corner():
    frame = grey(640, 480)
    drawn = draw_boxes(frame, np.array([[300.0, 200, 12, 12], [330, 200, 12, 12]]), ["f1", "f2"])
    near, listed = changed(frame, drawn)[190:225, 290:350], changed(frame, drawn)[:60, :60]
    assert near.any()
    assert changed(frame, drawn).sum() == near.sum() + listed.sum()
    assert (drawn[:60, :60] == object_colours(2)[1]).all(-1).any()


def test_particles_are_thinned_and_those_outside_are_skipped():
    frame, centres = grey(), np.full((1, 1000, 2), np.nan)
    assert not changed(frame, draw_particles(frame, centres)).any()
    centres[0, :, 0] = np.linspace(5, 115, 1000)
    centres[0, :, 1] = 45
    few = changed(frame, draw_particles(frame, centres, max_per_object=3)).any(axis=0)
    assert few[[5, 60, 115]].all()
    assert not few[20:40].any()
    centres[0, :, 0] = 1e12
    assert not changed(frame, draw_particles(frame, centres)).any()


def test_a_particle_is_a_filled_circle_that_the_frame_cuts():
    frame = grey(400, 300)
    drawn = changed(frame, draw_particles(frame, np.array([[[50.7, 60.2], [0.5, 299.5]]])))
    expected = cv2.circle(np.zeros(frame.shape[:2], np.uint8), (50, 60), 1, 1, cv2.FILLED)
    cv2.circle(expected, (0, 299), 1, 1, cv2.FILLED)
    np.testing.assert_array_equal(drawn, expected > 0)


@pytest.mark.parametrize("num_objects", [0, 1, 7, 21, 40])
def test_colours_are_distinct_as_far_as_they_reach(num_objects):
    colours = object_colours(num_objects)
    assert (colours.shape, colours.dtype) == ((num_objects, 3), np.uint8)
    assert len({tuple(colour) for colour in colours.tolist()}) == min(num_objects, 21)


def test_a_turned_rectangle_is_drawn_along_its_sides():
    frame = np.full((100, 120, 3), 40, np.uint8)
    corners = np.array([[[60, 30], [90, 60], [60, 90], [30, 60], [60, 30]]], float)
    colour = np.array([[255, 0, 0]], np.uint8)
    drawn = draw_outlines(frame, corners, ["a"], colour)
    for start, end in pairwise(corners[0]):
        x, y = np.floor((start + end) / 2 - 0.25).astype(int)
        window = drawn[y - 1 : y + 3, x - 1 : x + 3].astype(int)
        assert (window[..., 0] - window[..., 1]).max() > 150
    assert (drawn[60, 60] == 40).all()  # its middle is left as it was
    dashed = draw_outlines(frame, corners, ["a"], colour, doubtful=[True])
    dashes, sides = ((picture[62:, :, 0] > 200).sum() for picture in (dashed, drawn))
    assert 0.3 < dashes / sides < 0.8
