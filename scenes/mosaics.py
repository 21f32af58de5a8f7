"""Mosaics of coloured cells, and camera noise."""

import cv2
import numpy as np


def scattered(
    share: float, height: int, width: int, cell_size: int, rng: np.random.Generator
) -> np.ndarray:
    """``[h, w]`` bool: a random share of the square cells."""
    columns, rows = -(-width // cell_size), -(-height // cell_size)
    cells = np.arange(rows * columns) < round(share * rows * columns)
    grid = rng.permutation(cells).reshape(rows, columns)
    whole = np.kron(grid, np.ones((cell_size, cell_size), bool))
    return whole[:height, :width].astype(bool)


def coloured(hues: np.ndarray, saturation: float, brightness: float) -> np.ndarray:
    """Picture ``[h, w, 3]``, float RGB from 0 to 255, of hues ``[h, w]`` in turns (period 1)."""
    hsv = np.empty((*hues.shape, 3), np.float32)
    hsv[..., 0] = 360 * (hues % 1)
    hsv[..., 1] = saturation
    hsv[..., 2] = brightness
    return 255.0 * cv2.cvtColor(hsv, cv2.COLOR_HSV2RGB)


def with_noise(picture: np.ndarray, scale: float, rng: np.random.Generator) -> np.ndarray:
    """Add normal noise to every channel of ``picture`` and round to uint8."""
    return as_pixels(picture + scale * rng.standard_normal(picture.shape))


def as_pixels(picture: np.ndarray) -> np.ndarray:
    """Round grey levels or colours to uint8."""
    return np.clip(np.rint(picture), 0, 255).astype(np.uint8)
