"""The compared methods by name, and their runs on scenes modelled on the paper's sequences."""

import dataclasses
from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import jaxpf.points
import scenes
from jaxpf.contract.state import Summary
from jaxpf.dynamics.gaussian import AR2
from jaxpf.evaluation.baselines.optical_flow import follow_points
from jaxpf.evaluation.baselines.spot import spot
from jaxpf.measures.points import point_distances
from jaxpf.running.blocks import monte_carlo
from jaxpf.targets.presets import ESKIL2014

#: The paper's sequence -> our synthetic substitute, and sigma_t in pixels of our film: as printed,
#: but halved for the fish, whose film is half as wide.
SEQUENCES = {"platty": ("fish", 5.0), "skydiving": ("skydivers", 5.0), "face": ("face", 5.0)}
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


def tracker_of(
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


def on_scene(
    scene: str,
    scale: float,
    filters: tuple[str, ...],
    with_spot: range,
    parameters: Mapping[str, Any],
    seed: int,
) -> dict[str, Any]:
    """One run of every method on a scene of P points in T frames; the paper has one of each film.

    Returns:
        ``names`` ``[P]``, ``visible`` ``[T, P]`` bool, and by method the errors ``[T, P]``,
        distances divided by the body's length.
    """
    drawn = scenes.make(scene, seed=seed, **parameters)
    frames, truth = drawn.frames, drawn.extras["points"]
    keys, later = jax.random.split(jax.random.key(seed), 1), jnp.asarray(frames[1:])
    places = {}
    for name in filters:
        tracker = tracker_of(name, frames[0], truth[0], scale)
        places[name] = monte_carlo(tracker, keys, later, _estimate, batch_size=1)[0]
    places[FLOW] = follow_points(frames, truth[0])[0]
    if seed in with_spot:
        places[SPOT] = spot(frames, truth[0])
    places["not moving"] = np.broadcast_to(truth[0], truth[1:].shape)
    lengths = drawn.extras["body_length"][1:]
    return {
        "names": drawn.extras["point_names"],
        "visible": drawn.extras["visible"][1:],
        **{name: point_distances(each, truth[1:], lengths) for name, each in places.items()},
    }


def _estimate(state: object, summary: Summary) -> jax.Array:
    return summary.estimate
