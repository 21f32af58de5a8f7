"""Options of the box model."""

import dataclasses

from jaxpf.boxes.models import DEFAULT_MOMENTUM, DEFAULT_SCALE, DEFAULT_STEPS, LONE_STEPS
from jaxpf.contract.options import OPEN, check_options, option, plain
from jaxpf.targets.appearance import (
    BOXES,
    DISCRIMINATIVE,
    NONE,
    PIXELS,
    PRETRAINED,
    RELATIVE,
    appearance_option,
    bands_option,
    likelihood_option,
    network_option,
    noise_pixels_option,
    sharpness_option,
)


@dataclasses.dataclass(frozen=True)
class Options:
    """Options of the box model; see the help of each."""

    # None until the target resolves it, by the appearance.
    sharpness: float = sharpness_option(
        None, "likelihood.sharpness", "  By default 20 for colour, and 1 for learned appearance."
    )
    noise_pixels: tuple[float, ...] = noise_pixels_option(DEFAULT_SCALE, tuned=("[0]", "[1]"))
    bands: int = bands_option(2)
    likelihood: str = likelihood_option("auto", "integral", "sampled")
    appearance: str = appearance_option()
    network: str | None = network_option()
    motion: str = option(
        OPEN,
        "Unit of the noise: pixels (--noise-pixels), relative to the object's size "
        "(--noise-relative) or auto.  Relative noise is heavy-tailed; auto is relative unless "
        "appearance is colour.",
        choices=(OPEN, PIXELS, RELATIVE),
        common=True,
        compiles=True,
    )
    noise_relative: tuple[float, ...] | None = option(
        None,
        "Noise per frame, three standard deviations: of usual steps and of occasional long ones, "
        "as shares of the object's size, and of the logarithm of the size; by default "
        f"{plain(DEFAULT_STEPS)}, and {plain(LONE_STEPS)} for a single object (relative motion "
        "only).  Three numbers for all objects, or three for each.",
        kind=float,
        length=3,
        least=0,
        per_object=True,
        path="dynamics.steps",
        tuned=("[0]", "[1]"),
        implies=("motion", RELATIVE),
    )
    momentum: float = option(
        DEFAULT_MOMENTUM,
        "Share of the last displacement that is repeated (relative motion only).",
        least=0,
        most=1,
        implies=("motion", RELATIVE),
    )
    exclusion: str = option(
        NONE,
        "boxes keeps two boxes from explaining the same pixels, for look-alikes that meet; none "
        "does not (discriminative and pretrained appearance only).  If one box hides most of "
        "another, the hidden part does not count for the other.",
        choices=(NONE, BOXES),
        compiles=True,
        implies=("appearance", DISCRIMINATIVE),
        also_with=(PRETRAINED,),
    )

    def __post_init__(self) -> None:
        check_options(self)
