"""What the likelihoods refuse, and what they name: one row for each rule."""

import math

import numpy as np
from histograms import noise
from refusals import assert_names, every, message_of, outside

from jaxpf.likelihoods import (
    EdgeDetector,
    contours,
    discriminative,
    histogram,
    histogram_from_patches,
    patch,
    pixels,
    pretrained,
    pretrained_points,
    windows,
)
from jaxpf.likelihoods.contours.build import learn_clutter
from jaxpf.likelihoods.distance_law import learn_background
from jaxpf.likelihoods.histogram import open_histogram, with_object
from jaxpf.likelihoods.patch import patch_from_pictures
from jaxpf.shapes import space_of

FRAME = noise()  # 80 x 60 pixels
GOOD, POINTS = [[10, 10, 16, 16]], [[20, 15]]
POSES, SIZES = np.full((2, 3), 20.0), np.full((2, 2), 9)
FLAT = np.full_like(FRAME, 90)
SQUARE = np.array([(0, 0), (20, 0), (40, 0), (40, 20), (40, 40), (20, 40), (0, 40), (0, 20.0)])


def of_boxes(boxes=GOOD, frame=FRAME, **options):
    return histogram(frame, boxes, **options)


def of_patch(poses=POSES, sizes=SIZES, **options):
    return patch(FRAME, poses, sizes, **options)


def of_pixels(**options):
    return pixels([FRAME, FRAME], **{"sigma": 10.0} | options)


def of_points(points=POINTS, frame=FRAME, **options):
    return windows(frame, points, **{"window": (9, 9)} | options)


def learned(box=GOOD[0], frame=FRAME, **options):
    return discriminative(frame, [box], **options)


def of_network(frame):
    """Maps of one feature for 8 x 8 pixels."""
    return frame[::8, ::8, :1]


def of_pretrained(network=of_network):
    return pretrained(FRAME, GOOD, network=network)


def of_pretrained_points(points=POINTS, network=of_network, **options):
    return pretrained_points(FRAME, points, network=network, **options)


def of_contours(count=2, **options):
    space = space_of("translation", np.stack([SQUARE] * count), degree=1)
    return contours(space, count, **{"clutter": 0.5, "exclusion": "wires"} | options)


def clutter_of(shape, length=41):
    return learn_clutter(np.full(shape, 90, np.uint8), EdgeDetector(length=length))


def place_of(place, box):
    return with_object(open_histogram(2, FRAME.shape[:2]), place, FRAME, box)


#: Values outside of the ranges of arguments.
OUTSIDE = {
    of_boxes: {
        "sharpness": [0.0, np.inf],
        "bands": [0],
        "samples": [1, 1000],
        "num_particles": [-3],
        "method": ["fast"],
        "interpolation": ["cubic"],
        "form": ["odds"],
    },
    of_patch: {"sigma": [0.0], "window": [(0, 3)]},
    of_pixels: {
        "sigma": [0.0],
        "pool": ["sum"],
        "colour": ["hsv"],
        "min_slope": [-1.0],
        "size_term": [math.inf],
    },
    of_points: {"norm": ["max"], "slip": [-1.0]},
    learned: {"sharpness": [0.0], "interpolation": ["cubic"], "reach": [0.0]},
    of_pretrained_points: {"sharpness": [-1.0]},
    of_contours: {
        "exclusion": ["soft"],
        "sigma": [-1.0],
        "crossings": [0],
        "num_lines": [2],
        "independence": [0.0],
        "clutter": [-0.5],
    },
}


@outside(OUTSIDE)
def test_an_argument_outside_its_range_is_named(make, argument, value):
    assert_names(make, argument, value)


@every([
    (lambda: of_boxes([[10, 10, 0, 16]]), "boxes[0] is 0 pixels wide"),
    (lambda: of_boxes([[10, 10, 16, np.nan]]), "nan high"),
    (lambda: of_boxes([[10, -12, 16, 16]]), "band 0 of 2 has no pixel"),
    (lambda: of_boxes(frame=FRAME / 255), "frame is float64 [60, 80, 3]"),
    (lambda: of_boxes(frame=None), "frame is NoneType"),
    (lambda: of_boxes(bands=20), "20 of height"),
    (lambda: histogram_from_patches([FRAME * 1.0]), "patches[0] is float64"),
    (lambda: histogram_from_patches([FRAME], [[4, 0]]), "sizes[0]"),
    (lambda: learn_background(of_boxes(), FRAME[:10, :10]), "of 10 x 10"),
    (lambda: place_of(0, [10, 70, 8, 8]), "no pixel inside"),
    (lambda: place_of(0, [10, 10, 0.5, 8]), "at least 1 pixel"),
    (lambda: place_of(2, [10, 10, 8, 8]), "place = 2 must be a whole number from 0 to 1"),
    (lambda: of_patch(POSES + 500), "the window of object 0 is black"),
    (lambda: of_patch(sizes=SIZES * 0), "sizes[0] is 0 pixels wide"),
    (lambda: patch_from_pictures([FLAT, 0 * FLAT]), "pictures[1] is black"),
    (lambda: of_points([[80.0, 3.0]]), "point 0 is at (80, 3), outside the frame of 80 x 60"),
    (lambda: of_points(window=(81, 9)), "the window is 81 x 9 pixels and the frame 80 x 60"),
    (lambda: of_points(window=(8, 9)), "two odd numbers"),
    (lambda: of_points(frame=0 * FRAME), "the window of point 0 is black"),
    (lambda: learned((10, 10, 3, 20)), "at least 4 x 4 pixels"),
    (lambda: learned((1, 1, 79, 59)), "it fills the frame of 80 x 60 pixels"),
    (lambda: learned((70, 50, 40, 40)), "less than a quarter of it lies in the frame"),
    (lambda: learned(frame=FLAT), "looks like what is around it"),
    (lambda: learned().observe(FRAME[:, :70]), "70 x 60 pixels does not match the start frame of"),
    (lambda: of_pretrained(lambda frame: of_network(frame) * np.nan), "maps of boxes[0]"),
    (lambda: of_pretrained().log_prob_all(None, np.zeros(1, int), np.ones((3, 1))), "estimate"),
    (lambda: of_pretrained_points([[80.0, 5.0]]), "outside"),
    (lambda: of_pretrained_points(network=lambda x: of_network(x) * np.nan), "start frame"),
    (lambda: of_contours(width=16.0), "leave the width out"),
    (lambda: of_contours(crossings=5), "up to 10 boundaries"),
    (lambda: of_contours(clutter=1e-30), "clutter of mean 1e-30"),
    (lambda: of_contours(clutter=np.ones(7)), "sum to 1 or less"),
    *((lambda n=n: of_contours(n, exclusion="opaque"), f"{n} opaque target") for n in (1, 5)),
    (lambda: EdgeDetector(length=40), "odd number"),
    (lambda: EdgeDetector(max_features=22), "max_features"),
    (lambda: clutter_of((1, 30, 30, 3), length=15), "clutter cannot be learned"),
    (lambda: clutter_of((1, 30, 100, 3)), "do not fit"),
])  # fmt: skip
def test_what_cannot_be_learned_from_is_refused(call, named):
    assert named in message_of(call)
