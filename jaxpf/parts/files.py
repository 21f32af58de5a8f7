"""Articulated objects, and their files: start poses and tracks of parts.

A part is a rectangle at any angle.  In files, (x, y) is its centre in continuous pixels, with
pixel (0, 0) the square [0, 1) x [0, 1); the angle is in degrees, clockwise in the image; frames
count from 0.  In memory angles are in radians.
"""

import dataclasses
import os
from pathlib import Path

import numpy as np

from jaxpf.contract.errors import InputError
from jaxpf.contract.model import check_tree
from jaxpf.contract.numbers import check_number
from jaxpf.files.reading import check_name, parse_number, read_below

HEADER = "part,parent,x,y,w,h,angle"


@dataclasses.dataclass(frozen=True, eq=False)
class Parts:
    """The parts of one or several articulated objects.

    Attributes:
        names: of the P parts.
        parents: index of each part's parent, -1 for the root of an object.
        poses: ``[P, 3]``: x, y of the centre in pixels, and the angle in radians, clockwise.
        sizes: ``[P, 2]``: width and height in pixels.
    """

    names: tuple[object, ...]
    parents: tuple[int, ...]
    poses: np.ndarray
    sizes: np.ndarray

    def __post_init__(self) -> None:
        check_number("poses", self.poses)
        check_number("sizes", self.sizes, above=0)


def read_parts(path: str | os.PathLike[str]) -> Parts:
    """Read the parts of one or several articulated objects.

    The file is CSV with the header ``part,parent,x,y,w,h,angle``: a name, the parent's name (empty
    for the root of an object), centre, width and height in pixels, and the angle in degrees,
    clockwise.  The order of the parts is arbitrary.

    Args:
        path: the file; UTF-8, blank lines are skipped.

    Raises:
        InputError: the file cannot be read or a line is invalid; the message names it.
    """
    lines: dict[str, str] = {}
    parent_names, numbers = [], []
    for place, (name, parent, *fields) in read_below(Path(path), "parts", HEADER):
        check_name(name, place)
        if name in lines:
            raise InputError(
                f"{place} repeats the part '{name}' of {lines[name]}; give it another name"
            )
        lines[name] = place
        parent_names.append(parent)
        for column, field in zip(HEADER.split(",")[2:], fields, strict=True):
            numbers.append(parse_number(field, f"{place}: {column} is", "give a number"))
        width, height = numbers[-3:-1]
        if width <= 0 or height <= 0:
            raise InputError(
                f"{place}: part '{name}' has a box of {width:g} x {height:g} pixels, which has no "
                "area; give a positive w and h"
            )
    if not lines:
        raise InputError(f"'{path}' holds no parts; give one line {HEADER} for each")
    names = list(lines)
    parents = []
    for name, parent in zip(names, parent_names, strict=True):
        if parent and parent not in lines:
            raise InputError(
                f"{lines[name]}: part '{name}' hangs on '{parent[:40]}', which is no "
                f"part of the file; its parts are {', '.join(names)}"
            )
        parents.append(names.index(parent) if parent else -1)
    check_tree(parents, names, f"the parts of '{path}'")
    table = np.reshape(numbers, (-1, 5))
    return Parts(
        names=tuple(names),
        parents=tuple(parents),
        poses=np.column_stack([table[:, :2], np.deg2rad(table[:, 4])]),
        sizes=table[:, 2:4],
    )
