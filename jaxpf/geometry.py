"""Boxes, turned rectangles and what they have in common."""

from jaxpf.models.geometry import (
    area,
    boxes_from_substates,
    centres,
    corners_from_poses,
    cos_sin,
    intersection_area,
    is_proper,
    substates_from_boxes,
    turned,
)

__all__ = [
    "area",
    "boxes_from_substates",
    "centres",
    "corners_from_poses",
    "cos_sin",
    "intersection_area",
    "is_proper",
    "substates_from_boxes",
    "turned",
]
