"""Settings of published systems, by paper and target: the argument ``like`` of the factories.

A preset is the paper's system as printed, biased rules included; options that the caller gives
take precedence.  Noise that a paper does not state keeps this library's default.
"""

from collections.abc import Callable, Mapping
from typing import Any

from jaxpf import ordering as orderings
from jaxpf.contract.errors import InputError
from jaxpf.targets.target import Start

Preset = tuple[dict[str, Any], Any]


def preset(like: Any, target: str, start: Start) -> Preset:
    """Options of a paper's system, and its ordering if no option states it, else None.

    Raises:
        InputError: no system of that paper tracks the target.
    """
    known = PRESETS[target]
    if like not in known:
        raise InputError(
            f"like={like!r:.60} is not a published system of {target}; choose from "
            f"{', '.join(known)}."
        )
    return known[like](start)


def _smith2004(start: Start) -> Preset:
    """DPS, section 4, with the paper's reassembly; likelihood exp(-lambda d^2) of histograms."""
    options = {
        "num_particles": 300,
        "sharpness": 20.0,
        "noise_pixels": (2.0, 2.0, 0.001),
        "resampling": "multinomial",
        "appearance": "colour",
    }
    return options, orderings.dps(len(start.ids), reassembly="literal")


def _gonzales2011(start: Start) -> Preset:
    """SPS, sections 3.1 and 3.2: the sorted swap; every part moves on its own."""
    return {
        "method": "sps",
        "swap": "sorted",
        "resampling": "multinomial",
        "dynamics": "absolute",
        "slip": 0.0,
    }, None


def _eskil2014(start: Start) -> Preset:
    """Eq. 6 to 9 as printed: summed squares, distances held to 0.01 pixel, plain sum in eq. 9."""
    return {
        "method": "eskil",
        "window_size": 21,
        "momentum": 0.0,
        "sigma": 0.1,
        "norm": "sum",
        "shape": "pixels",
        "shape_scale": 0.01,
        "drift": "literal",
    }, None


def _maccormick1999(start: Any) -> Preset:
    """Wires: Condensation with eq. 2; closed contours: partitioned sampling with eq. 5."""
    shared = {"independence": 1.0, "sigma": 7.0}
    if start.contours.closed:
        closed = {"method": "ps", "num_particles": 750, "exclusion": "opaque-literal", "flip": 0.01}
        return shared | closed, None
    return shared | {"method": "sir", "exclusion": "wires-literal"}, None


#: Target -> paper -> function of the start.  rowe2005 has a builder of its own, in ``boxes``.
PRESETS: Mapping[str, Mapping[str, Callable[[Start], Preset]]] = {
    "boxes": {"smith2004": _smith2004},
    "parts": {"gonzales2011": _gonzales2011},
    "points": {"eskil2014": _eskil2014},
    "contours": {"maccormick1999": _maccormick1999},
}
