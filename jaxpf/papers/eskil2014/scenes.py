"""Run all methods on a set of scenes; the tables are computed from these runs."""

import functools
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

import scenes
from jaxpf.evaluation.baselines.optical_flow import follow_points
from jaxpf.evaluation.baselines.spot import spot
from jaxpf.measures import points as measures
from jaxpf.papers.checkpoints import of_scenes
from jaxpf.papers.eskil2014 import methods, published
from jaxpf.papers.judging.claims import counted
from jaxpf.papers.paper import Request
from jaxpf.running.blocks import monte_carlo

#: Runs per scene; the paper has one film of each kind.
RUNS_PER_SCENE = 1
_QUICK_FRAMES = 60
#: Sequences that are drawn for the first half of the seeds only, since they have many frames.
_LONG = ("skydiving",)


class Outcome(NamedTuple):
    """S scenes of one kind, R runs per scene (1 for a deterministic method), T frames, P points.

    SPOT has only the first ``methods.SPOT_SCENES`` scenes.

    Attributes:
        scene: name of the kind.
        names: names of the points.
        errors: method -> ``[S, R, T, P]``, distances divided by the body's length.
        visible: ``[S, T, P]`` bool.
    """

    scene: str
    names: tuple[str, ...]
    errors: Mapping[str, np.ndarray]
    visible: np.ndarray


def measure_all(request: Request) -> dict[str, Outcome]:
    """Run all measurements: one outcome for each kind of scene."""
    quick, seeds, report = request.quick, request.seeds, request.report
    outcomes = {}
    for name in ["platty"] if quick else list(published.SEQUENCES):
        scene, scale = published.SEQUENCES[name].scene, published.SEQUENCES[name].scale_here
        chosen = seeds[: -(-len(seeds) // 2)] if name in _LONG else seeds
        report(f"{name}: {counted(len(chosen), 'scenes')}, one run of every method on each")
        filters = methods.QUICK if quick else methods.FILTERS
        shorter = {"num_frames": _QUICK_FRAMES} if quick else {}
        with_spot = chosen[: methods.SPOT_SCENES]
        on_scene = functools.partial(_on_scene, scene, scale, filters, with_spot, shorter)
        found = of_scenes(scene, on_scene, chosen, report)
        names, visible = found.pop("names")[0], found.pop("visible")
        outcomes[scene] = Outcome(scene, tuple(map(str, names)), found, visible)
    return outcomes


def _on_scene(
    scene: str,
    scale: float,
    filters: Sequence[str],
    with_spot: Sequence[int],
    parameters: Mapping[str, Any],
    seed: int,
) -> dict[str, Any]:
    """Names and visibility of the points, and the errors of every method, on one scene."""
    drawn = scenes.make(scene, seed=seed, **parameters)
    truth, lengths = drawn.extras["points"], drawn.extras["body_length"][1:]
    others = [name for name in methods.OTHERS if name != methods.SPOT or seed in with_spot]
    places = track(drawn.frames, truth[0], scale, filters, others, seed)
    return {
        "names": drawn.extras["point_names"],
        "visible": drawn.extras["visible"][1:],
        **{
            method: measures.point_distances(of_method, truth[1:], lengths)
            for method, of_method in places.items()
        },
    }


def track(
    frames: np.ndarray,
    points: np.ndarray,
    scale: float,
    filters: Sequence[str],
    others: Sequence[str],
    seed: int,
) -> dict[str, np.ndarray]:
    """Method -> positions ``[R, T, P, 2]`` after the first frame, in which the points start."""
    later = jnp.asarray(frames[1:])
    keys, places = jax.random.split(jax.random.key(seed), RUNS_PER_SCENE), {}
    for name in filters:
        tracker = methods.tracker(name, frames[0], points, scale)
        estimates = monte_carlo(tracker, keys, later, _estimate, batch_size=RUNS_PER_SCENE)
        places[name] = np.asarray(estimates)
    if methods.FLOW in others:
        places[methods.FLOW] = follow_points(frames, points)[0][None]
    if methods.SPOT in others:
        places[methods.SPOT] = spot(frames, points)[None]
    if "not moving" in others:
        places["not moving"] = np.broadcast_to(points, (1, len(later), *points.shape))
    return places


def _estimate(state: Any, summary: Any) -> Any:
    return summary.estimate
