"""Options of appearance and motion, which several targets have, each with its own defaults."""

import contextlib
import re
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from jaxpf.contract.errors import InputError
from jaxpf.contract.options import OPEN, option, plain

#: How boxes are known, and by what they move.
COLOUR, DISCRIMINATIVE = "colour", "discriminative"
PIXELS, RELATIVE = "pixels", "relative"
NONE, BOXES = "none", "boxes"
_OF_COLOUR = ("appearance", COLOUR)
#: Grey levels by which the pixels of one colour differ at most.
_ONE_COLOUR = 2


def appearance_option() -> Any:
    """By what boxes are known."""
    return option(
        OPEN,
        "How objects are known: colour (histograms), discriminative or auto.  Discriminative "
        "learns in the start frame to tell each object from what is around it, by colours and "
        "gradients; auto is that in video, and colour in synthetic scenes.",
        choices=(OPEN, COLOUR, DISCRIMINATIVE),
        common=True,
        compiles=True,
    )


def gain_option(default: float) -> Any:
    """How much learned appearance is trusted."""
    return option(
        default,
        "Of discriminative appearance: larger trusts its score more.",
        above=0,
        path="likelihood.gain",
        tuned=("",),
        implies=("appearance", DISCRIMINATIVE),
    )


def motion_option() -> Any:
    """In what motion is measured."""
    return option(
        OPEN,
        "Noise in pixels (--scale), relative to the size (--relative-scale) or auto.  Relative "
        "noise is heavy-tailed; auto is relative with discriminative appearance.",
        choices=(OPEN, PIXELS, RELATIVE),
        common=True,
        compiles=True,
    )


def steps_option(usual: tuple[float, ...], lone: tuple[float, ...]) -> Any:
    """How far objects move from frame to frame, as shares of their size."""
    return option(
        None,
        "Of relative motion, noise per frame: of usual steps and of long ones, as shares of the "
        "object's size, and of the size's logarithm; for all objects, or three numbers for each.  "
        f"By default {plain(usual)}, and {plain(lone)} for a single object.",
        kind=float,
        length=3,
        least=0,
        per_object=True,
        path="dynamics.steps",
        tuned=("[0]", "[1]"),
        implies=("motion", RELATIVE),
    )


def momentum_option(default: float) -> Any:
    """How much of its last step an object repeats."""
    return option(
        default,
        "Of relative motion: share of the last displacement that is repeated.",
        least=0,
        most=1,
        implies=("motion", RELATIVE),
    )


def exclusion_option() -> Any:
    """Whether two boxes may be explained by the same pixels."""
    return option(
        NONE,
        "Of discriminative appearance: none, or boxes, where what one box covers of another, if it "
        "is most of it, does not count for that; for look-alikes that meet.",
        choices=(NONE, BOXES),
        compiles=True,
        implies=("appearance", DISCRIMINATIVE),
    )


def sharpness_option(default: float, path: str) -> Any:
    """How much colours are trusted."""
    return option(
        default,
        "Likelihood exp(-S d^2) of the colour distance d: larger trusts colours more.",
        above=0,
        path=path,
        tuned=("",),
        implies=_OF_COLOUR,
    )


def scale_option(default: tuple[float, float, float], **about: Any) -> Any:
    """How far objects move from frame to frame; ``about`` see ``jaxpf.contract.options.Option``."""
    return option(
        default,
        "Noise per frame: x and y in pixels, and the relative size; of parts, x, y and degrees of "
        "the root.",
        least=0,
        path="dynamics.scale",
        implies=("motion", PIXELS),
        **about,
    )


def bands_option(default: int) -> Any:
    """How a picture is divided."""
    return option(
        default,
        "Horizontal bands, each with a colour histogram of its own.",
        least=1,
        most=2**31 - 1,
        flags=("--parts",),
        compiles=True,
        implies=_OF_COLOUR,
    )


def likelihood_option(*choices: str) -> Any:
    """How likelihoods are computed."""
    return option(
        "auto",
        "How likelihoods are computed: integral or sampled histograms, auto for the faster of the "
        "two; for parts also patch, which compares pixels and suits grey pictures.",
        choices=choices,
        compiles=True,
        implies=_OF_COLOUR,
    )


def check_contrast(frame: Any, boxes: np.ndarray) -> None:
    """Refuse boxes on one colour, in front of the same.

    Args:
        frame: uint8 RGB ``[H, W, 3]``.
        boxes: x, y, w, h in pixels, ``[P, 4]``.

    Raises:
        InputError: which.
    """
    pixels = np.asarray(frame)
    for index, (x, y, width, height) in enumerate(boxes):
        left, top = (max(int(at - size / 2), 0) for at, size in ((x, width), (y, height)))
        around = pixels[top : int(y + 1.5 * height) + 1, left : int(x + 1.5 * width) + 1]
        if around.size and np.ptp(around, axis=(0, 1)).max() <= _ONE_COLOUR:
            raise InputError(
                f"boxes[{index}] lies on one colour, and so does what is around it, so that "
                "nothing tells where it is; give a box whose edges show, or another start frame."
            )


@contextlib.contextmanager
def naming(names: Sequence[str]) -> Iterator[None]:
    """The library counts objects from 0; people know them by names, which refusals get here."""
    try:
        yield
    except InputError as error:
        named = re.sub(
            r"(?:boxes|sizes|patches|pictures)\[(\d+)\]|the window of object (\d+)",
            lambda match: names[int(match[1] or match[2])],
            str(error),
        )
        raise InputError(named) from None
