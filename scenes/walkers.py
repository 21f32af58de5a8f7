"""Two people who pass each other, seen as heads and shoulders (maccormick1999, figures 1 and 6).

The paper's sequence was never published: two walkers, one of whom occludes the other for less than
a second, tracked in 8 + 8 dimensions.  Here each outline is a closed curve with two shifts and six
modes of deformation.  All numbers are our choices.

``extras``: ``outlines`` ``[T, 2, S, 2]``; ``closed``, true; ``front`` ``[T]``, the target nearer
the camera; ``examples`` ``[E, S, 2]``, similar outlines from which a shape space can be learned,
none of them from the sequence.
"""

import dataclasses
from typing import ClassVar

import numpy as np

from scenes import drawing as drawn
from scenes.parameters import Parameters
from scenes.scene import Scene

_PATHS, _BACKGROUND, _PIXELS, _EXAMPLES = range(4)
_POINTS = 80
_MODES = 6


@dataclasses.dataclass(frozen=True)
class WalkersParameters(Parameters):
    """Parameters of the walkers scene.

    Attributes:
        travel: distance that each walker covers, from one side to the other.
        clutter: standard deviation of the background.
        clutter_grain: its smoothing scale.
        noise: standard deviation of every pixel, in every frame.
    """

    scene: ClassVar[str] = "walkers"
    travel: float = 170.0
    clutter: float = 25.0
    clutter_grain: float = 4.0
    noise: float = 4.0

    body_height: ClassVar[float] = 120.0  # from the top of the head to the chest
    body_width: ClassVar[float] = 80.0  # across the shoulders
    step_height: ClassVar[float] = 3.0  # amplitude of bobbing
    step_period: ClassVar[float] = 14.0
    deformation: ClassVar[float] = 4.0  # standard deviation of each mode, pixels
    body_grey: ClassVar[float] = 70.0
    num_examples: ClassVar[int] = 80  # E


def walkers_scene(parameters: WalkersParameters, seed: int) -> Scene:
    """Draw the scene."""
    rng = np.random.default_rng([seed, _PATHS])
    count, modes = parameters.num_frames, _modes(parameters)
    share = np.linspace(-0.5, 0.5, count)
    outlines = np.empty((count, 2, _POINTS, 2))
    for target in range(2):
        side, phase = (-1) ** target, rng.uniform(0, 2 * np.pi)
        bob = np.sin(2 * np.pi * np.arange(count) / parameters.step_period + phase)
        middle = np.stack(
            [
                parameters.frame_width / 2 + side * share * parameters.travel,
                parameters.frame_height / 2 + parameters.step_height * bob,
            ],
            axis=1,
        )
        weights = drawn.wandering(rng, count, _MODES, 2 * parameters.step_period)
        weights = weights + rng.standard_normal(_MODES)
        bodies = _body(parameters) + np.einsum("tm,msc->tsc", weights, modes)
        outlines[:, target] = middle[:, None] + bodies
    front = int(rng.integers(2))
    frames = _draw_frames(parameters, seed, outlines, front)
    rng = np.random.default_rng([seed, _EXAMPLES])
    weights = 1.4 * rng.standard_normal((parameters.num_examples, _MODES))
    return drawn.make_scene(
        frames,
        outlines,
        parameters,
        seed,
        closed=True,
        front=np.full(count, front),
        examples=_body(parameters) + np.einsum("em,msc->esc", weights, modes),
    )


def _body(parameters: WalkersParameters) -> np.ndarray:
    """Head and shoulders about the origin, ``[S, 2]``, clockwise from the top."""
    # Radius by angle: a narrow head, a neck, broad shoulders, a flat chest.
    corners = np.array(
        [(0, -0.5), (0.13, -0.46), (0.19, -0.33), (0.13, -0.19), (0.2, -0.12), (0.42, -0.02),
         (0.5, 0.15), (0.48, 0.5), (0.2, 0.5)]
    )  # fmt: skip
    mirrored = corners[:0:-1] * (-1, 1)
    line = np.concatenate([corners, mirrored, corners[:1]])
    along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    at = np.linspace(0, along[-1], _POINTS, endpoint=False)
    points = np.stack([np.interp(at, along, line[:, axis]) for axis in range(2)], axis=1)
    return points * (parameters.body_width, parameters.body_height)


def _modes(parameters: WalkersParameters) -> np.ndarray:
    """Deformations ``[6, S, 2]``, each ``deformation`` pixels at its largest point."""
    body = _body(parameters)
    x, y = (body / np.abs(body).max(axis=0)).T
    head, none = np.clip(-2 * y - 0.4, 0, 1), np.zeros_like(x)
    modes = np.array(
        [
            (x, none),
            (none, y),
            (y, none),
            (head, none),
            (none, np.abs(x) * (y < 0.5)),
            (x * head, none),
        ]
    ).transpose(0, 2, 1)
    size = np.linalg.norm(modes, axis=2).max(axis=1)
    return parameters.deformation * modes / size[:, None, None]


def _draw_frames(
    parameters: WalkersParameters, seed: int, outlines: np.ndarray, front: int
) -> np.ndarray:
    height, width = parameters.frame_height, parameters.frame_width
    rng = np.random.default_rng([seed, _BACKGROUND])
    ground = 150 + parameters.clutter * drawn.texture(rng, height, width, parameters.clutter_grain)
    rng = np.random.default_rng([seed, _PIXELS])
    frames = np.empty((len(outlines), height, width, 3), np.uint8)
    for frame, bodies in zip(frames, outlines, strict=True):
        picture = ground.copy()
        for target in (1 - front, front):
            grey = parameters.body_grey
            drawn.paint_body(picture, bodies[target], grey, seam=grey + 50)
        frame[...] = drawn.noisy(picture, parameters.noise, rng)
    return frames
