"""Shape spaces: how a contour may differ from its template, given or learned."""

from jaxpf.shapes.bending import BendingSpace, bending_space
from jaxpf.shapes.learning import learn_shape_space, outline_of, varied
from jaxpf.shapes.spaces import (
    ShapeSpace,
    check_contours,
    explained_share,
    key_frame_space,
    space_of,
)

__all__ = [
    "BendingSpace",
    "ShapeSpace",
    "bending_space",
    "check_contours",
    "explained_share",
    "key_frame_space",
    "learn_shape_space",
    "outline_of",
    "space_of",
    "varied",
]
