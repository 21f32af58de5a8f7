"""Run all methods on a set of scenes; the tables are computed from these runs."""

import functools
from collections.abc import Callable, Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import scenes
from jaxpf.contract.state import Summary
from jaxpf.evaluation.baselines.optical_flow import follow_points
from jaxpf.evaluation.baselines.spot import spot
from jaxpf.measures.points import point_distances
from jaxpf.papers.checkpoints import of_scenes
from jaxpf.papers.eskil2014 import methods
from jaxpf.papers.eskil2014.measures import measures
from jaxpf.papers.judging.claims import counted
from jaxpf.papers.study import Study, tidy
from jaxpf.running.blocks import monte_carlo

#: Runs per scene; the paper has one film of each kind.
RUNS_PER_SCENE = 1
_QUICK_FRAMES = 60


#: The paper's sequence -> our synthetic substitute, and sigma_t in pixels of our film: as printed,
#: but halved for the fish, whose film is half as wide.
SEQUENCES = {"platty": ("fish", 5.0), "skydiving": ("skydivers", 5.0), "face": ("face", 5.0)}


def measure_all(seeds: range, quick: bool, report: Callable[[str], None]) -> Study:
    """Run all measurements; the figures show names, visibility and errors by kind of scene."""
    found = {}
    for name in ["platty"] if quick else list(SEQUENCES):
        scene, scale = SEQUENCES[name]
        report(f"{name}: {counted(len(seeds), 'scenes')}, one run of every method on each")
        filters = methods.QUICK if quick else methods.FILTERS
        shorter = {"num_frames": _QUICK_FRAMES} if quick else {}
        with_spot = seeds[: methods.SPOT_SCENES]
        on_scene = functools.partial(_on_scene, scene, scale, filters, with_spot, shorter)
        found[scene] = of_scenes(scene, on_scene, seeds, report)
    return study(found)


def study(found: Mapping[str, Mapping[str, np.ndarray]]) -> Study:
    """Rows of all measures, from the arrays ``[S, ...]`` of ``_on_scene`` by kind of scene."""
    values: dict[tuple[str, str, str], list[float]] = {}
    words: dict[str, str] = {}
    for scene, arrays in found.items():
        names = [str(name) for name in arrays["names"][0]]
        errors = {name: each for name, each in arrays.items() if name not in ("names", "visible")}
        spot = f", of SPOT {len(errors[methods.SPOT])}" if methods.SPOT in errors else ""
        words |= {f"points_{scene}": str(len(names)), f"spot_{scene}": spot}
        for method, of_method in errors.items():
            for of_scene, visible in zip(of_method, arrays["visible"], strict=False):
                for name, value in measures(scene, names, of_scene, visible).items():
                    values.setdefault((name, method, ""), []).append(value)
    return Study(tidy(values), found, words)


def _on_scene(
    scene: str,
    scale: float,
    filters: tuple[str, ...],
    with_spot: range,
    parameters: Mapping[str, Any],
    seed: int,
) -> dict[str, Any]:
    """Of P points in T frames of one scene: ``names`` ``[P]``, ``visible`` ``[T, P]`` bool, and by
    method the errors ``[R, T, P]``, distances divided by the body's length.
    """
    drawn = scenes.make(scene, seed=seed, **parameters)
    frames, truth = drawn.frames, drawn.extras["points"]
    keys, later = jax.random.split(jax.random.key(seed), RUNS_PER_SCENE), jnp.asarray(frames[1:])
    places = {}
    for name in filters:
        tracker = methods.tracker(name, frames[0], truth[0], scale)
        places[name] = monte_carlo(tracker, keys, later, _estimate, batch_size=RUNS_PER_SCENE)
    places[methods.FLOW] = follow_points(frames, truth[0])[0][None]
    if seed in with_spot:
        places[methods.SPOT] = spot(frames, truth[0])[None]
    places["not moving"] = np.broadcast_to(truth[0], (1, *truth[1:].shape))
    lengths = drawn.extras["body_length"][1:]
    return {
        "names": drawn.extras["point_names"],
        "visible": drawn.extras["visible"][1:],
        **{name: point_distances(each, truth[1:], lengths) for name, each in places.items()},
    }


def _estimate(state: object, summary: Summary) -> jax.Array:
    return summary.estimate
