"""Checks the parameters of a scene; the error message names the wrong one."""

import dataclasses
import math
import numbers
from collections.abc import Collection
from typing import Any, Literal, get_args, get_origin

from scenes.scene import SceneError

#: Parameters of every scene, always above 0.
_COMMON = ("num_frames", "frame_width", "frame_height", "fps")


def check_parameters(
    scene: str,
    parameters: Any,
    *,
    above_0: Collection[str] = (),
    shares: Collection[str] = (),
    signed: Collection[str] = (),
    **least: float,
) -> None:
    """Refuse parameters of a wrong type or out of range.

    Args:
        scene: its name.
        parameters: its dataclass, with fields of type ``int``, ``float``, tuples of these, or a
            ``Literal`` of words; numbers must be finite and not negative.
        above_0: fields that must be above 0, besides the length, size and rate of the frames.
        shares: fields that must lie between 0 and 1.
        signed: fields that may be negative.
        least: minimum values of other fields.

    Raises:
        SceneError: naming the parameter.
    """
    positive = {*_COMMON, *above_0} - {*least}
    for field in dataclasses.fields(parameters):
        name, value = field.name, getattr(parameters, field.name)
        kinds = get_args(field.type)
        if get_origin(field.type) is Literal:
            one_of = f"must be one of {', '.join(kinds)}"
            require(scene, parameters, name, value in kinds, one_of)
            continue
        values = (value,)
        if get_origin(field.type) is tuple:
            fits = isinstance(value, tuple | list) and (... in kinds or len(value) == len(kinds))
            count = "" if ... in kinds else f"{len(kinds)} "
            require(scene, parameters, name, fits, f"must be {count}numbers in a row")
            values = value
        kind, word = (numbers.Integral, "whole") if field.type is int else (numbers.Real, "finite")
        for x in values:
            is_number = isinstance(x, kind) and not isinstance(x, bool) and math.isfinite(x)
            require(scene, parameters, name, is_number, f"must be a {word} number")
            require(scene, parameters, name, name not in positive or x > 0, "must be above 0")
            between = name not in shares or 0 <= x <= 1
            require(scene, parameters, name, between, "must lie between 0 and 1")
            require(scene, parameters, name, name in signed or x >= 0, "must not be negative")
            enough = x >= least.get(name, x)
            require(scene, parameters, name, enough, f"must be at least {least.get(name)}")


def require(scene: str, parameters: object, name: str, holds: bool, remedy: str) -> None:
    """Refuse the parameters unless ``holds``; ``remedy`` says what must hold of ``name``.

    Raises:
        SceneError: ``holds`` is false.
    """
    if not holds:
        raise SceneError(f"scene {scene!r}: {name} = {getattr(parameters, name)!r} {remedy}")
