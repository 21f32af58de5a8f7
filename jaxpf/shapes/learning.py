"""Key frames from annotations: masks, outlines, or centrelines.

Principal components compare point with point, so the k-th control point must mean the same in
every example.  Outlines get a common orientation and the starting point that fits the first
example best; centrelines start at the end that fits best.  ``ordered`` skips this for examples
whose points already correspond.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from jaxpf.contract.errors import InputError, check_known
from jaxpf.contract.numbers import check_whole
from jaxpf.shapes.spaces import ShapeSpace, key_frame_space
from jaxpf.shapes.splines import check_order, fit_spline, resample_polyline

#: Annotation formats of contours.
ANNOTATIONS = ("masks", "outlines", "centrelines")

#: Points per control point when examples are compared.
_FINENESS = 16


def learn_shape_space(
    examples: Sequence[ArrayLike],
    kind: str,
    *,
    num_points: int,
    dimension: int,
    ordered: bool = False,
) -> tuple[ShapeSpace, np.ndarray]:
    """A space of key frames (``jaxpf.shapes.key_frame_space``) from annotations.

    Args:
        examples: by ``kind``: ``"masks"``, pictures ``[H, W]``, nonzero on the target (the
            largest connected piece is used); ``"outlines"``, closed polylines ``[S, 2]``;
            ``"centrelines"``, open polylines ``[S, 2]``; pixels.  Lengths may differ.
        kind: one of ``ANNOTATIONS``.
        num_points: K, control points of each contour.
        dimension: D, see ``key_frame_space``.
        ordered: the examples' points already correspond and are not reordered.

    Returns:
        The space, and the examples' control points ``[S, K, 2]``, whose projections are the
        examples' substates.

    Raises:
        InputError: the kind is unknown, there are too few examples, or a mask is empty.
    """
    check_known("kind ", kind, ANNOTATIONS)
    check_order(num_points)
    closed = kind != "centrelines"
    lines = (
        [outline_of(mask, k) for k, mask in enumerate(examples)] if kind == "masks" else examples
    )
    even = [resample_polyline(line, _FINENESS * num_points, closed=closed) for line in lines]
    if closed and even and not ordered:
        even[0] = _clockwise(even[0])
    if not ordered:
        even = [*even[:1], *(_matched(line, even[0], closed) for line in even[1:])]
    contours = [fit_spline(line, num_points, closed=closed) for line in even]
    control = np.array(contours).reshape(-1, num_points, 2)
    return key_frame_space(control, dimension, closed=closed), control


def augment(examples: ArrayLike, turns: int) -> np.ndarray:
    """Augment open contours: as given and reversed, each also mirrored, all in several rotations.

    For bodies that bend to either side in any orientation, if there are few examples.

    Args:
        examples: control points ``[S, K, 2]``.
        turns: number of rotations, evenly spaced.

    Returns:
        ``[4 * turns * S, K, 2]``.
    """
    examples = np.asarray(examples, float)
    check_whole("turns", turns)
    both = np.concatenate([examples, examples[:, ::-1]])
    every = np.concatenate([both, both * (-1, 1)])
    middles = every.mean(axis=1, keepdims=True)
    angles = 2 * np.pi * np.arange(turns) / turns
    matrices = np.array([[(np.cos(a), np.sin(a)), (-np.sin(a), np.cos(a))] for a in angles])
    return np.concatenate([(every - middles) @ matrix + middles for matrix in matrices])


def outline_of(mask: ArrayLike, number: int = 0) -> np.ndarray:
    """Outline ``[S, 2]`` of the largest piece of a mask ``[H, W]``, in continuous pixels.

    Args:
        mask: nonzero on the target.
        number: the mask's number in error messages.

    Raises:
        InputError: the mask is empty.
    """
    import cv2

    marked = (np.asarray(mask) != 0).astype(np.uint8)
    if not marked.any():
        raise InputError(
            f"mask {number} of shape {list(marked.shape)} marks nothing; give a picture [H, W] "
            "that is not 0 on the target."
        )
    outlines, _ = cv2.findContours(marked, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    largest = max(outlines, key=len)[:, 0].astype(float)
    if len(largest) < 3:
        raise InputError(
            f"mask {number} marks {int(marked.sum())} pixel(s), which have no outline; mark more."
        )
    # OpenCV joins the centres of the outermost pixels, half a pixel inside the target.
    return _grown(_clockwise(largest) + 0.5, 0.5)


def _clockwise(points: np.ndarray) -> np.ndarray:
    x, y = points.T
    doubled_area = np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))
    return points if doubled_area > 0 else points[::-1]


def _grown(points: np.ndarray, distance: float) -> np.ndarray:
    """A clockwise outline moved outwards by ``distance``."""
    along = np.roll(points, -1, axis=0) - np.roll(points, 1, axis=0)
    length = np.linalg.norm(along, axis=1, keepdims=True)
    outwards = np.stack([along[:, 1], -along[:, 0]], axis=1) / np.where(length > 0, length, 1.0)
    return points + distance * outwards


def _matched(points: np.ndarray, first: np.ndarray, closed: bool) -> np.ndarray:
    """The points reordered (new start, or reversed) to be nearest to ``first``."""
    target = first - first.mean(axis=0)
    if closed:
        points = _clockwise(points)
        candidates = [np.roll(points, -k, axis=0) for k in range(len(points))]
    else:
        candidates = [points, points[::-1]]
    distances = [np.sum((c - c.mean(axis=0) - target) ** 2) for c in candidates]
    return candidates[int(np.argmin(distances))]
