"""Tracks points by pyramidal optical flow with a forward-backward check.

Source: Lucas and Kanade 1981; Bouguet 2000 (pyramids, ``cv2.calcOpticalFlowPyrLK``); Kalal,
Mikolajczyk and Matas 2010 (forward-backward error).
"""

from collections.abc import Iterable

import cv2
import numpy as np
from numpy.typing import ArrayLike

#: Side of the window in pixels, and pyramid levels above the full frame.
_WINDOW, _LEVELS = 21, 4
#: Largest forward-backward error, pixels.
_LARGEST_ERROR = 1.0


def follow_points(frames: Iterable[np.ndarray], points: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Track points from frame to frame.

    If a point's forward-backward error exceeds a pixel, the point stays where it was and tracking
    continues from there in the next frame.

    Args:
        frames: T + 1 frames, uint8 RGB [H, W, 3].
        points: [P, 2], x and y in pixels in the first frame; pixel i has its centre at i + 0.5.

    Returns:
        Positions [T, P, 2] in the frames after the first, and whether each point was tracked,
        bool [T, P].
    """
    before, here = None, np.asarray(points, np.float32) - np.float32(0.5)
    places, followed = [], []
    for frame in frames:
        grey = cv2.cvtColor(np.ascontiguousarray(frame), cv2.COLOR_RGB2GRAY)
        if before is not None:
            column = here[:, None]
            there, status = _flow(before, grey, column)
            back, status_back = _flow(grey, before, there)
            error = np.linalg.norm(back - column, axis=-1)[:, 0]
            good = (status[:, 0] == 1) & (status_back[:, 0] == 1) & (error <= _LARGEST_ERROR)
            here = np.where(good[:, None], there[:, 0], here)
            places.append(here + 0.5)
            followed.append(good)
        before = grey
    count = len(here)
    return np.reshape(places, (-1, count, 2)), np.reshape(np.array(followed, bool), (-1, count))


def _flow(before, after, places):
    there, status, _ = cv2.calcOpticalFlowPyrLK(
        before, after, places, np.empty_like(places), winSize=(_WINDOW, _WINDOW), maxLevel=_LEVELS
    )
    return there, status
