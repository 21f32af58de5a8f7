"""What the drawing of contours shows: hidden parts are dark and broken, likelier ones are wider."""

import numpy as np

from jaxpf.contours.drawing import draw_contour_particles

GREY = np.full((120, 200, 3), 128, np.uint8)
COLOURS = np.array([(250, 250, 0)], np.uint8)


def level(y):
    """A horizontal line, ``[41, 2]``."""
    return np.stack([np.linspace(20, 180, 41), np.full(41, float(y))], axis=1)


def drawn(picture):
    return np.abs(picture.astype(int) - 128).max(axis=-1) > 20


def test_hidden_parts_are_dark_and_dashed():
    hidden = np.zeros((1, 1, 41), bool)
    hidden[..., 20:] = True
    picture = draw_contour_particles(GREY, level(60)[None, None], [1.0], hidden, COLOURS)
    row = picture[58:63].astype(int)
    seen, dark = row[:, 30:90], row[:, 110:170]
    assert drawn(seen).any(axis=0).all()
    assert 0.2 < drawn(dark).any(axis=0).mean() < 0.95
    assert dark[..., 0].max() < seen[..., 0].max()


def test_likelier_particles_are_wider_and_unlikely_ones_are_left_out():
    lines = np.stack([level(20), level(60), level(100)])[:, None]
    mark = drawn(draw_contour_particles(GREY, lines, [1.0, 0.3, 1e-6], colours=COLOURS))
    wide, narrow, none = mark[10:30].sum(), mark[50:70].sum(), mark[90:110].sum()
    assert wide > narrow > 0
    assert none == 0
