"""Two similar pieces of wire that come together and separate (maccormick1999, figure 4).

The paper shows only stills: two wires of similar shape which, "for several frames in the middle
of the sequence, have very similar configurations".  All numbers are our choices.

``extras``: ``outlines`` ``[T, 2, S, 2]``, the centreline of each wire from end to end; ``closed``,
false; ``meeting``, first and last frame of the meeting; ``background`` ``[H, W, 3]``, without
wires.
"""

import dataclasses
from typing import ClassVar

import numpy as np

from scenes import drawing as drawn
from scenes.parameters import Count, Parameters
from scenes.scene import Scene

_PATHS, _BACKGROUND, _PIXELS = range(3)
_POINTS = 60


@dataclasses.dataclass(frozen=True)
class WiresParameters(Parameters):
    """Parameters of the wires scene.

    Attributes:
        wire_width: thickness of the drawn line.
        bend: amplitude of a wire's bend to either side.
        meeting_distance: distance between them while they are together.
        meeting_frames: duration of the meeting, in the middle of the sequence.
        contrast: difference between the ground and the darker wire, grey levels.
        clutter: standard deviation of the ground's grey levels.
        clutter_grain: smoothing scale of the ground.
        noise: standard deviation of every pixel, in every frame.
    """

    scene: ClassVar[str] = "wires"
    wire_width: Count = 3
    bend: float = 22.0
    meeting_distance: float = 7.0
    meeting_frames: int = 12
    contrast: float = 90.0
    clutter: float = 12.0
    clutter_grain: float = 3.0
    noise: float = 4.0

    wire_length: ClassVar[float] = 130.0  # from end to end
    unlikeness: ClassVar[float] = 0.15  # relative difference in bend between the wires
    start_distance: ClassVar[float] = 92.0  # between centres, in the first and last frame
    wander: ClassVar[float] = 3.0  # standard deviation in x and y
    turning: ClassVar[float] = 4.0  # the same for the angle, degrees
    wander_period: ClassVar[float] = 30.0


def wires_scene(parameters: WiresParameters, seed: int) -> Scene:
    """Generate the scene."""
    outlines, meeting = wires_paths(parameters, np.random.default_rng([seed, _PATHS]))
    height, width = parameters.frame_height, parameters.frame_width
    rng = np.random.default_rng([seed, _BACKGROUND])
    ground = 150 + parameters.clutter * drawn.texture(rng, height, width, parameters.clutter_grain)
    rng = np.random.default_rng([seed, _PIXELS])
    frames = np.empty((parameters.num_frames, height, width, 3), np.uint8)
    for frame, wires in zip(frames, outlines, strict=True):
        picture = ground.copy()
        for wire in wires:
            drawn.paint_line(picture, wire, 150 - parameters.contrast, parameters.wire_width)
        frame[...] = drawn.noisy(picture, parameters.noise, rng)
    return drawn.make_scene(
        frames,
        outlines,
        parameters,
        seed,
        closed=False,
        meeting=meeting,
        background=drawn.noisy(ground, parameters.noise, rng),
    )


def wires_paths(
    parameters: WiresParameters, rng: np.random.Generator
) -> tuple[np.ndarray, tuple[int, int]]:
    """Return the centrelines of the wires ``[T, 2, S, 2]``, and first and last meeting frame.

    With the defaults no point moves more than 4.8 pixels per frame, and the second wire stays right
    of the first.
    """
    count = parameters.num_frames
    times, middle = np.arange(count), (count - 1) / 2
    half = parameters.meeting_frames / 2
    apart = np.clip((np.abs(times - middle) - half) / max(middle - half, 1), 0, 1)
    apart_smoothly = _eased(apart)
    far, near = parameters.start_distance, parameters.meeting_distance
    distance = near + (far - near) * apart_smoothly
    together = np.flatnonzero(apart == 0)
    meeting = (int(together[0]), int(together[-1])) if len(together) else (count // 2, count // 2)
    along = np.linspace(-0.5, 0.5, _POINTS)
    paths = drawn.wandering(rng, count, 6, parameters.wander_period)
    # Random motion decreases as the wires approach each other, to keep their distance.
    paths *= 0.2 + 0.8 * apart_smoothly[:, None]
    outlines = np.empty((count, 2, _POINTS, 2))
    for wire in range(2):
        bend = parameters.bend * (1 + wire * parameters.unlikeness)
        shape = np.stack(
            [bend * np.sin(2 * np.pi * (along + 0.1 * wire * parameters.unlikeness)),
             parameters.wire_length * along], axis=1
        )  # fmt: skip
        side = (-1) ** (wire + 1) / 2
        x, y, turn = paths[:, 3 * wire : 3 * wire + 3].T
        angle = np.deg2rad(parameters.turning * turn)[:, None]
        cosine, sine = np.cos(angle), np.sin(angle)
        outlines[:, wire, :, 0] = (
            parameters.frame_width / 2
            + (side * distance + parameters.wander * x)[:, None]
            + cosine * shape[:, 0]
            - sine * shape[:, 1]
        )
        outlines[:, wire, :, 1] = (
            parameters.frame_height / 2
            + (parameters.wander * y)[:, None]
            + sine * shape[:, 0]
            + cosine * shape[:, 1]
        )
    return outlines, meeting


def _eased(share: np.ndarray) -> np.ndarray:
    """Ease from 0 to 1 with ``share``: accelerate for a quarter, move steadily, and decelerate."""
    ramp = 0.25
    begins, ends = share**2 / (2 * ramp), 1 - ramp - (1 - share) ** 2 / (2 * ramp)
    steady = share - ramp / 2
    return np.where(share < ramp, begins, np.where(share > 1 - ramp, ends, steady)) / (1 - ramp)
