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
from scenes.distracter_pictures import draw_frames, paint_textures
from scenes.mosaics import with_noise
from scenes.scene import Scene

# Every ingredient has its own random stream, so that changing, say, the noise level keeps the
# trajectories of a seed.
_LAYOUT, _TEXTURES, _BACKGROUND, _PIXELS, _PATCHES = range(5)


def distracter_scene(parameters: DistracterParameters, seed: int = 0) -> Scene:
    """Generate the scene; the same parameters and seed give the same scene, bit for bit.

    Patch 0 is the distracter's, as in the paper; the others are the objects'
    own.  ``extras`` holds ``distracter_boxes [T, 4]``, NaN where there is no distracter,
    ``distracter_patch``, and ``object_patch``, the patch of object 1 itself.  Boxes are continuous;
    objects are drawn at the nearest whole pixel.
    """
    centres, distracter_centres = draw_layout(parameters, _generator(seed, _LAYOUT))
    textures, distracter_texture = paint_textures(parameters, _generator(seed, _TEXTURES))
    boxes = _boxes_around(centres, parameters)
    distracter_boxes = _boxes_around(distracter_centres, parameters)
    frames = draw_frames(
        parameters,
        boxes,
        textures,
        distracter_boxes,
        distracter_texture,
        background_rng=_generator(seed, _BACKGROUND),
        pixel_rng=_generator(seed, _PIXELS),
    )

    # Reference patches have noise, like the objects in the frames.
    rng = _generator(seed, _PATCHES)
    patches = [with_noise(texture, parameters.object_noise, rng) for texture in textures]
    distracter_patch = with_noise(distracter_texture, parameters.object_noise, rng)
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


def _generator(seed: int, stream: int) -> np.random.Generator:
    return np.random.default_rng([seed, stream])


def _boxes_around(centres: np.ndarray, parameters: DistracterParameters) -> np.ndarray:
    """``[..., 4]`` boxes around centres ``[..., 2]``; all NaN for a NaN centre."""
    size = np.array([parameters.object_width, parameters.object_height], dtype=np.float64)
    sizes = np.where(np.isnan(centres), np.nan, size)
    return np.concatenate([centres - size / 2, sizes], axis=-1)
