"""Settings of published systems, by paper and target: the argument ``like`` of the factories.

A preset is the system that ``jaxpf reproduce`` judges: the paper's, as printed, biased rules
included.  Options that the caller gives take precedence.  Noise that a paper does not state keeps
this library's default.
"""

from collections.abc import Callable, Mapping
from typing import Any

from jaxpf import ordering as orderings
from jaxpf.targets.target import Start

#: gonzales2011: lambda of the likelihood, and the range around the object in which particles
#: start, in pixels, pixels and radians, which the paper leaves open.
GONZALES2011_SHARPNESS, GONZALES2011_REACH = 50.0, (5.0, 5.0, 0.1)
#: eskil2014, table 2, for its own method and for PFFL.  ``noise_points`` is sigma_t of two of its
#: three films; that of the third, of 1080 x 1920 pixels, is 10.
ESKIL2014: Mapping[str, Any] = {
    "window_size": 21,
    "sigma": 0.1,
    "noise_points": 5.0,
    "momentum": 0.0,
    "norm": "sum",
}
_LINES: Mapping[str, Any] = {"independence": 1.0, "sigma": 7.0, "resampling": "multinomial"}
#: maccormick1999: wires by Condensation with eq. 2, in whose figure 4 N is not printed, and opaque
#: targets by partitioned sampling with eq. 5.
MACCORMICK1999: Mapping[str, Mapping[str, Any]] = {
    "wires": {**_LINES, "method": "sir", "exclusion": "wires-literal", "num_particles": 300},
    "opaque": {
        **_LINES,
        "method": "ps",
        "exclusion": "opaque-literal",
        "shape_space": "affine",
        "num_particles": 750,
        "flip": 0.01,
    },
}


def _smith2004(start: Start) -> dict[str, Any]:
    """DPS, section 4, with the paper's reassembly; likelihood exp(-lambda d^2) of histograms."""
    return {
        "ordering": orderings.dps(start.num_partitions, reassembly="literal"),
        "num_particles": 300,
        "sharpness": 20.0,
        "noise_pixels": (2.0, 2.0, 0.001),
        "resampling": "multinomial",
        "appearance": "colour",
        "likelihood": "integral",  # of all pixels
    }


def _gonzales2011(start: Start) -> dict[str, Any]:
    """SPS, sections 3.1 and 3.2: the sorted swap; every part moves on its own."""
    return {
        "method": "sps",
        "swap": "sorted",
        "resampling": "multinomial",
        "dynamics": "absolute",
        "sharpness": GONZALES2011_SHARPNESS,
        "slip": 0.0,
        "reach": GONZALES2011_REACH,
    }


def _eskil2014(start: Start) -> dict[str, Any]:
    """Eq. 6 to 9 as printed: summed squares, distances held to 0.01 pixel, plain sum in eq. 9."""
    own = {"method": "eskil", "shape": "pixels", "shape_scale": 0.01, "drift": "literal"}
    return {**ESKIL2014, **own}


def _pffl(start: Start) -> dict[str, Any]:
    """What eskil2014 compares with: eq. 5, without its authors' learned prior."""
    return {**ESKIL2014, "method": "pffl", "form": "literal"}


def _maccormick1999(start: Any) -> dict[str, Any]:
    """Closed contours hide one another, and open ones are wires."""
    options = {**MACCORMICK1999["opaque" if start.contours.closed else "wires"]}
    if start.learned is not None:
        options.pop("shape_space", None)
    return options


#: Target -> paper -> function of the start that returns options of the factory.  rowe2005 has a
#: builder, see ``Target.systems``.
PRESETS: Mapping[str, Mapping[str, Callable[[Start], dict[str, Any]]]] = {
    "boxes": {"smith2004": _smith2004},
    "parts": {"gonzales2011": _gonzales2011},
    "points": {"eskil2014": _eskil2014, "pffl": _pffl},
    "contours": {"maccormick1999": _maccormick1999},
}
