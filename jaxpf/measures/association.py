"""Overlap of every box with every other, for matching tracks, detections and objects."""

import numpy as np
from numpy.typing import ArrayLike

from jaxpf.contract.errors import InputError


def pairwise_overlap(one: ArrayLike, other: ArrayLike) -> np.ndarray:
    """Intersection over union of every pair of boxes, in double precision.

    ``jaxpf.measures.overlap`` compares boxes elementwise in JAX.  Scores that threshold overlaps
    need double precision to agree with other tools.

    Args:
        one: x, y, w, h ``[P, 4]``.
        other: ``[Q, 4]``.

    Returns:
        float64 ``[P, Q]``; 0 where a box is not finite or has no width or no height.

    Raises:
        InputError: boxes of another length than 4.
    """
    for boxes in (one, other):
        if np.size(boxes) and np.shape(boxes)[-1:] != (4,):
            raise InputError(
                f"boxes have the shape {list(np.shape(boxes))}; give x, y, w, h [P, 4]."
            )
    one = _proper_or_empty(one)[:, None]
    other = _proper_or_empty(other)[None, :]
    start = np.maximum(one[..., :2], other[..., :2])
    end = np.minimum(one[..., :2] + one[..., 2:], other[..., :2] + other[..., 2:])
    common = np.prod(np.maximum(end - start, 0), axis=-1)
    union = np.prod(one[..., 2:], axis=-1) + np.prod(other[..., 2:], axis=-1) - common
    return np.divide(common, union, out=np.zeros_like(common), where=union > 0)


def _proper_or_empty(boxes: ArrayLike) -> np.ndarray:
    boxes = np.asarray(boxes, np.float64).reshape(-1, 4)
    is_finite = np.isfinite(boxes).all(axis=1, keepdims=True)
    has_area = (boxes[:, 2:] > 0).all(axis=1, keepdims=True)
    return np.where(is_finite & has_area, boxes, 0)
