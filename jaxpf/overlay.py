"""Tracks drawn on frames."""

from jaxpf.media.contours_overlay import draw_contours
from jaxpf.media.overlay import (
    DARK,
    draw_boxes,
    draw_particles,
    draw_pixel_grid,
    draw_rectangles,
    label_at,
    line_thickness,
    object_colours,
)
from jaxpf.media.points_overlay import draw_points

__all__ = [
    "DARK",
    "draw_boxes",
    "draw_contours",
    "draw_particles",
    "draw_pixel_grid",
    "draw_points",
    "draw_rectangles",
    "label_at",
    "line_thickness",
    "object_colours",
]
