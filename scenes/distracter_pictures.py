"""Pictures of the distracter scene: mosaics of four hues, pasted over a background of noise."""

import numpy as np

from scenes.distracter_parameters import DistracterParameters
from scenes.mosaics import coloured, scattered, with_noise


def paint_textures(
    parameters: DistracterParameters, rng: np.random.Generator
) -> tuple[list[np.ndarray], np.ndarray]:
    """Return the objects' textures ``[h, w, 3]`` float, and the distracter's.

    Each half shows two hues.  All hues differ between halves and between objects, so that
    histograms of the top and bottom halves distinguish all objects.
    """
    textures = []
    for number in range(parameters.num_objects):
        hue = number / parameters.num_objects
        is_accent = _choose_cells(parameters, parameters.accent_share, rng)
        textures.append(_paint(parameters, is_accent, (hue, hue + 0.45), (hue + 0.12, hue + 0.6)))
    is_foreign = _choose_cells(parameters, 1 - parameters.likeness, rng)
    foreign = _paint(parameters, is_foreign, (0.25, 0.8), (0.25, 0.8))
    return textures, np.where(is_foreign[..., None], foreign, textures[0])


def draw_frames(
    parameters: DistracterParameters,
    boxes: np.ndarray,
    textures: list[np.ndarray],
    distracter_boxes: np.ndarray,
    distracter_texture: np.ndarray,
    background_rng: np.random.Generator,
    pixel_rng: np.random.Generator,
) -> np.ndarray:
    """``[T, H, W, 3]`` uint8: background, objects, and the distracter on top."""
    background = _draw_background(parameters, background_rng)
    frames = []
    for frame in range(parameters.num_frames):
        picture = background.copy()
        for number, texture in enumerate(textures):
            _paste(picture, boxes[frame, number], texture, parameters, pixel_rng)
        if not np.isnan(distracter_boxes[frame, 0]):
            _paste(picture, distracter_boxes[frame], distracter_texture, parameters, pixel_rng)
        frames.append(picture)
    return np.stack(frames)


def _choose_cells(
    parameters: DistracterParameters, share: float, rng: np.random.Generator
) -> np.ndarray:
    """``[h, w]`` bool: the given share of the cells of each half, scattered at random."""
    halves = np.bincount(_is_bottom(parameters).astype(int)).tolist()
    width, size = parameters.object_width, parameters.cell_size
    return np.concatenate([scattered(share, height, width, size, rng) for height in halves])


def _paint(
    parameters: DistracterParameters,
    is_accent: np.ndarray,
    main_hues: tuple[float, float],
    accent_hues: tuple[float, float],
) -> np.ndarray:
    """A patch ``[h, w, 3]`` in four hues (0 to 1): main and accent hues of top and bottom."""
    is_bottom = _is_bottom(parameters)[:, None]
    hues = np.where(
        is_accent,
        np.where(is_bottom, accent_hues[1], accent_hues[0]),
        np.where(is_bottom, main_hues[1], main_hues[0]),
    )
    return coloured(hues, parameters.saturation, parameters.brightness)


def _is_bottom(parameters: DistracterParameters) -> np.ndarray:
    return np.arange(parameters.object_height) >= parameters.object_height // 2


def _draw_background(parameters: DistracterParameters, rng: np.random.Generator) -> np.ndarray:
    grain = parameters.background_grain
    rows, columns = -(-parameters.frame_height // grain), -(-parameters.frame_width // grain)
    mean = np.full((rows, columns, 3), parameters.background_mean)
    coarse = with_noise(mean, parameters.background_noise, rng)
    fine = coarse.repeat(grain, axis=0).repeat(grain, axis=1)
    return fine[: parameters.frame_height, : parameters.frame_width]


def _paste(
    picture: np.ndarray,
    box: np.ndarray,
    texture: np.ndarray,
    parameters: DistracterParameters,
    rng: np.random.Generator,
) -> None:
    """Draw one object in place; the layout guarantees that it lies within the frame."""
    left, top = np.floor(box[:2] + 0.5).astype(int)
    height, width = texture.shape[:2]
    noisy = with_noise(texture, parameters.object_noise, rng)
    picture[top : top + height, left : left + width] = noisy
