"""The methods compared, by name: trackers of points from a frame and where they start."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

import jaxpf.points
from jaxpf.experiments.eskil2014.published import PFFL_PARTICLES, SHAPE_SCALE, SIGMA

PROPOSED, PFFL, SPOT, FLOW = "eskil2014", "PFFL", "SPOT", "Lucas-Kanade"

#: Options of ``jaxpf.points.tracker``; what is not said has its default.
_OPTIONS: Mapping[str, dict[str, Any]] = {
    PROPOSED: {},
    "eskil2014 as printed": {
        "norm": "sum",
        "sigma": SIGMA,
        "shape": "pixels",
        "shape_scale": SHAPE_SCALE,
    },
    "without drift": {"drift": "none"},
    "without shape": {"shape": "none"},
    "signed drift": {"drift": "signed"},
    "ridge drift": {"drift": "ridge"},
    PFFL: {"method": "pffl", "particles": PFFL_PARTICLES},
    "PFFL as printed": {
        "method": "pffl",
        "particles": PFFL_PARTICLES,
        "form": "literal",
        "norm": "sum",
        "sigma": SIGMA,
    },
    # As many likelihoods for every point as PFFL.
    "SIR": {"method": "sir", "particles": 2 * PFFL_PARTICLES},
    "PS": {"method": "ps", "particles": 2 * PFFL_PARTICLES},
    "SPS": {"method": "sps", "particles": 2 * PFFL_PARTICLES},
}
FILTERS = tuple(_OPTIONS)
#: Deterministic, once per clip or scene.
OTHERS = (SPOT, FLOW, "not moving")
QUICK = (PROPOSED, PFFL, "PS")


def trackers(
    frame: np.ndarray, points: np.ndarray, scale: float, names: Sequence[str] = FILTERS
) -> dict[str, Any]:
    """Method -> tracker.

    Args:
        frame: uint8 RGB [H, W, 3], with the points in it.
        points: [P, 2], pixels.
        scale: sigma_t, pixels.
        names: of ``FILTERS``.
    """
    return {
        name: jaxpf.points.tracker(frame, points, diffusion=scale, **_OPTIONS[name])
        for name in names
    }
