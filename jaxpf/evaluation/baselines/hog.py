"""Histograms of oriented gradients (HOG) on a grid of cells over a whole frame.

Source: Dalal and Triggs 2005.  Nine unsigned orientations; each cell is normalised by the four
blocks of two by two cells that contain it.
"""

import cv2
import numpy as np

ORIENTATIONS = 9
#: Features of a cell: its histogram, normalised by each of four blocks.
FEATURES = 4 * ORIENTATIONS

# Normalised values are clipped here (Dalal and Triggs).
_LARGEST = 0.2


def hog(frame: np.ndarray, cell: int) -> np.ndarray:
    """HOG features, float32 [H // cell, W // cell, FEATURES], of a uint8 RGB frame [H, W, 3].

    Cell (i, j) is the square of pixels [j * cell, (j + 1) * cell) x [i * cell, (i + 1) * cell).
    """
    rows, columns = frame.shape[0] // cell, frame.shape[1] // cell
    picture = np.ascontiguousarray(frame[: rows * cell, : columns * cell]).astype(np.float32) / 255
    across: np.ndarray = cv2.filter2D(picture, -1, np.array([[-1.0, 0.0, 1.0]]))
    down: np.ndarray = cv2.filter2D(picture, -1, np.array([[-1.0], [0.0], [1.0]]))
    strength = across**2 + down**2
    channel = np.argmax(strength, axis=-1)[..., None]  # the channel with the steepest gradient
    across, down, strength = (
        np.take_along_axis(values, channel, axis=-1)[..., 0] for values in (across, down, strength)
    )
    strength = np.sqrt(strength)
    place = np.mod(np.arctan2(down, across) / np.pi, 1.0) * ORIENTATIONS
    lower = np.floor(place - 0.5)
    share = place - 0.5 - lower
    histogram = np.empty((rows, columns, ORIENTATIONS), np.float32)
    first = np.mod(lower, ORIENTATIONS).astype(np.uint8)
    second = np.mod(lower + 1, ORIENTATIONS).astype(np.uint8)
    for bin_number in range(ORIENTATIONS):
        votes = strength * ((first == bin_number) * (1 - share) + (second == bin_number) * share)
        # INTER_AREA gives the mean over each cell; cells are whole pixels, so none is split.
        histogram[..., bin_number] = cv2.resize(
            votes.astype(np.float32), (columns, rows), interpolation=cv2.INTER_AREA
        )
    energy = np.pad((histogram**2).sum(axis=-1), 1, mode="edge")
    blocks = energy[:-1, :-1] + energy[1:, :-1] + energy[:-1, 1:] + energy[1:, 1:]
    normalised = [
        np.minimum(
            histogram / np.sqrt(blocks[i : i + rows, j : j + columns, None] + 1e-4), _LARGEST
        )
        for i in (0, 1)
        for j in (0, 1)
    ]
    return np.concatenate(normalised, axis=-1)
