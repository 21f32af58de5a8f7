"""The synthetic test of Smith and Gatica-Perez (smith2004, section 3): a distracter.

Several objects move over a background of noise.  A distracter that resembles the first object
appears on top of it, moves away from it and disappears.  The first object's reference patch is the
distracter's, so that a tracker prefers the distracter while it is present and follows it; the test
is whether the tracker then recovers the object.

The paper specifies the number and size of the frames, the number of objects, the motion and the
frames in which the distracter appears and vanishes.  Everything else is our choice, documented in
``DistracterParameters``.
"""

import dataclasses

import numpy as np

from scenes.distracter_layout import draw_layout
from scenes.distracter_parameters import DistracterParameters
from scenes.mosaics import coloured, scattered, with_noise
from scenes.scene import Scene

# Every ingredient has its own random stream, so that changing, say, the noise level keeps the
# trajectories of a seed.
_STREAMS = range(5)  # trajectories, textures, background, pixels, patches


def distracter_scene(parameters: DistracterParameters, seed: int = 0) -> Scene:
    """Generate the scene; the same parameters and seed give the same scene, bit for bit.

    Patch 0 is the distracter's, as in the paper; the others are the objects'
    own.  ``extras`` holds ``distracter_boxes [T, 4]``, NaN where there is no distracter,
    ``distracter_patch``, and ``object_patch``, the patch of object 1 itself.  Boxes are continuous;
    objects are drawn at the nearest whole pixel.
    """
    layout, looks, ground, pixels, patch_noise = (
        np.random.default_rng([seed, stream]) for stream in _STREAMS
    )
    centres, distracter_centres = draw_layout(parameters, layout)
    textures, distracter_texture = _paint_textures(parameters, looks)
    boxes = _boxes_around(centres, parameters)
    distracter_boxes = _boxes_around(distracter_centres, parameters)
    background = _draw_background(parameters, ground)
    frames = np.repeat(background[None], parameters.num_frames, axis=0)
    for frame, object_boxes, distracter_box in zip(frames, boxes, distracter_boxes, strict=True):
        for box, texture in zip(object_boxes, textures, strict=True):
            _paste(frame, box, with_noise(texture, parameters.object_noise, pixels))
        if not np.isnan(distracter_box[0]):
            noisy = with_noise(distracter_texture, parameters.object_noise, pixels)
            _paste(frame, distracter_box, noisy)
    # Reference patches have noise, like the objects in the frames.
    patches = [with_noise(texture, parameters.object_noise, patch_noise) for texture in textures]
    distracter_patch = with_noise(distracter_texture, parameters.object_noise, patch_noise)
    return Scene(
        name="distracter",
        frames=frames,
        boxes=boxes,
        patches=[distracter_patch, *patches[1:]],
        fps=parameters.fps,
        parameters={**dataclasses.asdict(parameters), "seed": seed},
        extras={
            "distracter_boxes": distracter_boxes,
            "distracter_patch": distracter_patch,
            "object_patch": patches[0],
        },
    )


def _boxes_around(centres: np.ndarray, parameters: DistracterParameters) -> np.ndarray:
    """``[..., 4]`` boxes around centres ``[..., 2]``; all NaN for a NaN centre."""
    size = np.array([parameters.object_width, parameters.object_height], dtype=np.float64)
    sizes = np.where(np.isnan(centres), np.nan, size)
    return np.concatenate([centres - size / 2, sizes], axis=-1)


def _paint_textures(
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


def _paste(picture: np.ndarray, box: np.ndarray, patch: np.ndarray) -> None:
    """Draw one object in place; the layout guarantees that it lies within the frame."""
    left, top = np.floor(box[:2] + 0.5).astype(int)
    height, width = patch.shape[:2]
    picture[top : top + height, left : left + width] = patch
