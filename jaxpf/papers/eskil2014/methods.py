"""The compared methods by name: point trackers built from a frame and initial points."""

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

import jaxpf.points
from jaxpf.dynamics.gaussian import AR2
from jaxpf.targets.presets import ESKIL2014

#: M of PFFL.
PFFL_PARTICLES = 50
PROPOSED, PFFL, SPOT, FLOW = "eskil2014", "PFFL", "SPOT", "Lucas-Kanade"
PRINTED, WITH_DRIFT = "eskil2014 as printed", "PFFL with drift"
#: The printed sigma_p, .01, has no unit: other readings than pixels.
OF_DISTANCE, OF_FRAME = "as printed, .01 of a distance", "as printed, .01 of the width"
#: Share of the last displacement that a particle of "PFFL with drift" repeats; not published.
MOMENTUM = 0.25

#: The published settings of the model, but a mean of squares.
_MODEL: Mapping[str, Any] = {**ESKIL2014, "norm": "mean", "method": "eskil"}
#: Options of ``jaxpf.points.tracker`` beside them.
_OPTIONS: Mapping[str, dict[str, Any]] = {
    PROPOSED: {},
    PRINTED: {"like": "eskil2014"},
    OF_DISTANCE: {"like": "eskil2014", "shape": "relative"},
    OF_FRAME: {"like": "eskil2014"},
    "without drift": {"drift": "none"},
    "without shape": {"shape": "none"},
    "signed drift": {"drift": "signed"},
    "ridge drift": {"drift": "ridge"},
    PFFL: {"method": "pffl", "num_particles": PFFL_PARTICLES},
    "PFFL as printed": {"like": "pffl"},
    # The paper's sketch moves particles by drift and diffusion but defines no drift.
    WITH_DRIFT: {"method": "pffl", "num_particles": PFFL_PARTICLES},
    # The same number of likelihood evaluations per point as PFFL.
    "SIR": {"method": "sir", "num_particles": 2 * PFFL_PARTICLES},
    "PS": {"method": "ps", "num_particles": 2 * PFFL_PARTICLES},
    "SPS": {"method": "sps", "num_particles": 2 * PFFL_PARTICLES},
}
FILTERS = tuple(_OPTIONS)
#: Scenes of each kind on which SPOT runs, which takes a quarter of a second per frame.
SPOT_SCENES = 25
QUICK = (PROPOSED, PFFL, "PS")


def tracker(
    name: str,
    frame: np.ndarray,
    points: np.ndarray,
    scale: float,
) -> Any:
    """Build the tracker of a method.

    Args:
        name: a name in ``FILTERS``.
        frame: uint8 RGB [H, W, 3], which shows the points.
        points: [P, 2], pixels.
        scale: sigma_t, pixels.
    """
    own = _OPTIONS[name]
    options = {**({} if "like" in own else _MODEL), **own, "noise_points": scale}
    if name == OF_FRAME:
        options["shape_scale"] = 0.01 * frame.shape[1]
    point_tracker = jaxpf.points.tracker(frame, points, **options)
    if name == WITH_DRIFT:
        dynamics = AR2(np.float32(scale), np.float32(MOMENTUM))
        return dataclasses.replace(point_tracker, dynamics=dynamics)
    return point_tracker
