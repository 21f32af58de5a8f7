"""Options of appearance and motion that several targets share, each with its own defaults."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from jaxpf.contract.errors import InputError
from jaxpf.contract.options import OPEN, option
from jaxpf.contract.ranges import RANGES

#: Values of ``--appearance``, ``--motion`` and ``--exclusion``.
COLOUR, DISCRIMINATIVE, PRETRAINED = "colour", "discriminative", "pretrained"
WINDOWS = "windows"
PIXELS, RELATIVE = "pixels", "relative"
NONE, BOXES = "none", "boxes"
_OF_COLOUR = ("appearance", COLOUR)
#: A region whose grey levels differ by at most this counts as one colour.
_ONE_COLOUR = 2


def appearance_option() -> Any:
    """Appearance model of boxes."""
    return option(
        OPEN,
        "Appearance model: colour, discriminative, pretrained or auto (discriminative in video).  "
        "Colour compares histograms; discriminative learns in the start frame to distinguish each "
        "object from its surroundings, by colours and gradients; pretrained also by the features "
        "of a small network, which usually lose fewer objects (pip install 'jaxpf[pretrained]').  "
        "Auto is colour in synthetic scenes.",
        choices=(OPEN, COLOUR, DISCRIMINATIVE, PRETRAINED),
        common=True,
        compiles=True,
    )


def sharpness_option(default: float | None, path: str, more: str = "") -> Any:
    """Sharpness of the appearance likelihood; ``more`` ends its help."""
    return option(
        default,
        "Sharpness S of the likelihood, such as exp(-S d^2) of the colour distance d: larger "
        f"trusts appearance more, and gives narrower intervals.{more}",
        **RANGES["sharpness"],
        path=path,
        tuned=("",),
    )


def network_option() -> Any:
    """Weights of the network of pretrained appearance."""
    return option(
        None,
        "File with the weights of EfficientNet-lite0, .pth or .npz; by default those of "
        "'jaxpf[pretrained]' (pretrained appearance only).",
        kind=str,
        implies=("appearance", PRETRAINED),
    )


def noise_pixels_option(default: tuple[float, float, float], **about: Any) -> Any:
    """Process noise in pixels; ``about``: see ``jaxpf.contract.options.Option``."""
    return option(
        default,
        "Noise per frame: x and y in pixels, and the relative size (for parts: x, y and "
        "degrees, of the root or, with absolute dynamics, of every part).",
        least=0,
        path="dynamics.scale",
        implies=("motion", PIXELS),
        **about,
    )


def slip_option() -> Any:
    """Error of points, parts and contours that the particles do not show."""
    return option(
        None,
        "Widens the intervals: standard deviation in pixels of an object around its best match "
        "(points, parts and contours only).  By default, as measured on film, 8 for points, 0.6 of "
        "the median shorter side for parts, 0.1 of the size for open contours and 0.05 for closed "
        "ones; 0 in synthetic scenes.",
        kind=float,
        **RANGES["slip"],
    )


def bands_option(default: int) -> Any:
    """Number of horizontal bands of a colour histogram."""
    return option(
        default,
        "Number of horizontal bands, each with a colour histogram of its own (boxes: colour "
        "appearance only).",
        least=1,
        most=2**31 - 1,
        compiles=True,
        implies=_OF_COLOUR,
    )


def likelihood_option(*choices: str) -> Any:
    """How the likelihood is computed."""
    return option(
        "auto",
        "How likelihoods are computed (boxes: colour appearance only): from integral or sampled "
        "histograms, or auto for the faster one.  For parts also patch, which compares pixels and "
        "suits grey pictures.",
        choices=choices,
        compiles=True,
        implies=_OF_COLOUR,
    )


def check_contrast(frame: np.ndarray, boxes: np.ndarray, names: Sequence[str]) -> None:
    """Reject boxes of one uniform colour on a background of the same colour.

    Args:
        frame: uint8 RGB ``[H, W, 3]``.
        boxes: x, y, w, h in pixels, ``[P, 4]``.
        names: of the boxes, ``[P]``, for the message.

    Raises:
        InputError: a box cannot be located.
    """
    pixels = np.asarray(frame)
    for name, (x, y, width, height) in zip(names, boxes, strict=True):
        left, top = (max(int(at - size / 2), 0) for at, size in ((x, width), (y, height)))
        around = pixels[top : int(y + 1.5 * height) + 1, left : int(x + 1.5 * width) + 1]
        if around.size and np.ptp(around, axis=(0, 1)).max() <= _ONE_COLOUR:
            raise InputError(
                f"{name} lies on one colour, and so does what is around it, so that "
                "it cannot be located; give a box whose edges show, or another start frame."
            )
