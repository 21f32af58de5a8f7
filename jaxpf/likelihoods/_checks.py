"""Argument checks shared by the image likelihoods."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from jaxpf.contract.errors import InputError

#: How the squared differences of a window are combined.
NORMS = ("mean", "sum")
#: How colours are read at positions between pixels.
INTERPOLATIONS = ("nearest", "bilinear")


def check_positive(name: str, value: Any) -> None:
    """Reject numbers that are not positive and finite."""
    if not (math.isfinite(value) and value > 0):
        raise InputError(f"{name} is {value}: it must be positive and finite.")


def check_choice(name: str, value: Any, known: Sequence[str]) -> None:
    """Reject an unknown name."""
    if value not in known:
        raise InputError(f"{name} is {value!r}: choose one of {', '.join(map(repr, known))}.")


def check_window(window: Any, example: str) -> None:
    """Reject a grid that is not two positive integers, columns and rows."""
    if len(window) != 2 or not all(isinstance(n, int) and n >= 1 for n in window):
        raise InputError(
            f"window is {window!r}: give columns and rows of a grid, such as {example}."
        )


def check_window_sizes(sizes: np.ndarray, count: int, noun: str) -> None:
    """Reject widths and heights ``[count, 2]`` below one pixel."""
    if sizes.shape != (count, 2):
        raise InputError(
            f"sizes has shape {list(sizes.shape)}: give (width, height) for each of the {count} "
            f"{noun}."
        )
    for i, (width, height) in enumerate(sizes):
        if not (math.isfinite(width * height) and width >= 1 and height >= 1):
            raise InputError(
                f"sizes[{i}] is {width:g} x {height:g} pixels: use at least 1 of each."
            )
