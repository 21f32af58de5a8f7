"""Drawn scenes: dataclasses whose fields are parameters, with their ranges in annotations."""

import dataclasses
import math
import numbers
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, get_args, get_origin

import numpy as np

from scenes.scene import Scene, SceneError


class Range(NamedTuple):
    """Where numbers must lie.

    Attributes:
        least: smallest number.
        most: largest number.
        is_open: whether the smallest number itself is excluded.
    """

    least: float = 0.0
    most: float = math.inf
    is_open: bool = False


#: Kinds of numbers; a plain ``float`` or ``int`` must not be negative.
Above0 = Annotated[float, Range(0, is_open=True)]
Count = Annotated[int, Range(1)]
Share = Annotated[float, Range(0, 1)]
Signed = Annotated[float, Range(-math.inf)]


@dataclasses.dataclass(frozen=True)
class Drawn:
    """A drawn scene; lengths in pixels, times in frames, colours in grey levels from 0 to 255.

    Fields are parameters; numbers must be finite and in the range of their annotation.  The same
    parameters and seed give the same scene, bit for bit.

    Attributes:
        num_frames: length of the sequence.
        frame_width: width of a frame.
        frame_height: height of a frame.
        fps: frames per second; it affects only playback.
    """

    num_frames: Count = 60
    frame_width: Count = 320
    frame_height: Count = 240
    fps: Above0 = 25.0

    name: ClassVar[str]

    def draw(self, seed: int) -> Scene:
        """Draw the scene; the class documents its ``extras``."""
        raise NotImplementedError

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            self.require(field.name, *_fits(getattr(self, field.name), field.type))

    def require(self, name: str, holds: bool, remedy: str) -> None:
        """Refuse the parameters unless ``holds``; ``remedy`` says what must hold of ``name``."""
        if not holds:
            raise SceneError(f"scene {self.name!r}: {name} = {getattr(self, name)!r} {remedy}")

    @property
    def size(self) -> np.ndarray:
        """``[2]``: width and height of a frame."""
        return np.array([self.frame_width, self.frame_height])

    def check_in_view(self, outlines: np.ndarray) -> None:
        """Refuse objects, outlines ``[T, P, S, 2]``, of which a point leaves the frame."""
        outside = np.argwhere(((outlines < 0) | (outlines > self.size)).any(axis=(2, 3)))
        for frame, target in outside:
            raise SceneError(
                f"scene {self.name!r}: object {target} leaves the {self.frame_width} x "
                f"{self.frame_height} frame in frame {frame}; take a larger frame, fewer or "
                "smaller objects, or less motion"
            )

    def scene(
        self, seed: int, frames: Any, boxes: np.ndarray, patches: list[np.ndarray], **extras: Any
    ) -> Scene:
        """The scene of these pictures, with all parameters and the seed."""
        parameters = {**dataclasses.asdict(self), "seed": seed}
        return Scene(self.name, frames, boxes, patches, self.fps, parameters, extras)


def streams(seed: int, count: int) -> list[np.random.Generator]:
    """A random stream for every ingredient.

    Changing one, such as the noise level, then keeps the others, such as the trajectories.
    """
    return [np.random.default_rng([seed, stream]) for stream in range(count)]


def _fits(value: Any, kind: Any) -> tuple[bool, str]:
    """Whether a value is of a kind, and the kind in words."""
    kinds = get_args(kind)
    if get_origin(kind) is Literal:
        return value in kinds, f"must be one of {', '.join(kinds)}"
    if get_origin(kind) is tuple:
        is_row = isinstance(value, tuple | list) and (... in kinds or len(value) == len(kinds))
        words = _fits(0, kinds[0])[1]
        count = "several numbers" if ... in kinds else f"{len(kinds)} numbers"
        return is_row and all(_fits(x, kinds[0])[0] for x in value), f"({count}) {words}"
    plain, (least, most, is_open) = kinds or (kind, Range())
    number = numbers.Integral if plain is int else numbers.Real
    is_number = isinstance(value, number) and not isinstance(value, bool) and math.isfinite(value)
    holds = is_number and least <= value <= most and not (is_open and value == least)
    bounds = f" {'above' if is_open else 'of at least'} {least:g}" if least > -math.inf else ""
    bounds += f" and at most {most:g}" if most < math.inf else ""
    return holds, f"must be a {'whole' if plain is int else 'finite'} number{bounds}"
