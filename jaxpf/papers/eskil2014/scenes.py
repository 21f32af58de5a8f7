"""Run all methods on a set of scenes; the tables are computed from these runs."""

import functools
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

import scenes
from jaxpf.evaluation.baselines.optical_flow import follow_points
from jaxpf.evaluation.baselines.spot import spot
from jaxpf.measures import points as measures
from jaxpf.papers.checkpoints import Measure, each
from jaxpf.papers.eskil2014 import methods
from jaxpf.running.blocks import monte_carlo

#: Runs per scene; the paper has one film of each kind.
RUNS_PER_SCENE = 1


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


def measure(
    scene: str,
    scale: float,
    seeds: Sequence[int],
    filters: Sequence[str] = methods.FILTERS,
    others: Sequence[str] = methods.OTHERS,
    report: Callable[[str], None] = print,
    **parameters: Any,
) -> Outcome:
    """Track scenes by all methods, one scene per seed.

    Args:
        scene: name of a scene of points.
        scale: sigma_t, pixels.
        seeds: S seeds of the scenes.
        filters: names in ``methods.FILTERS``.
        others: names in ``methods.OTHERS``.
        report: receives lines of progress.
        parameters: scene parameters that differ from their defaults.
    """
    errors: dict[str, list[np.ndarray]] = {}
    visible, names = [], ()

    def parts() -> Iterator[tuple[str, Measure]]:
        for place, seed in enumerate(seeds):
            with_spot = place < methods.SPOT_SCENES
            here = [name for name in others if name != methods.SPOT or with_spot]
            args = scene, seed, parameters, scale, filters, here
            yield f"{scene}-{seed}", functools.partial(_on_scene, *args)

    for done, (seed, places) in enumerate(zip(seeds, each(parts()), strict=True), start=1):
        drawn = _drawn(scene, seed, **parameters)
        truth, names = drawn.extras["points"][1:], drawn.extras["point_names"]
        lengths = drawn.extras["body_length"][1:]
        for method, estimates in places.items():
            distances = measures.point_distances(estimates, truth, lengths)
            errors.setdefault(method, []).append(distances)
        visible.append(drawn.extras["visible"][1:])
        report(f"  {scene}: scene {done} of {len(seeds)} done")
    stacked = {method: np.stack(each) for method, each in errors.items()}
    return Outcome(scene, tuple(names), stacked, np.stack(visible))


@functools.lru_cache(maxsize=1)  # used for tracking, then for the errors
def _drawn(scene: str, seed: int, **parameters: Any) -> scenes.Scene:
    return scenes.make(scene, seed=seed, **parameters)


def _on_scene(
    scene: str,
    seed: int,
    parameters: Mapping[str, Any],
    scale: float,
    filters: Sequence[str],
    others: Sequence[str],
) -> dict[str, np.ndarray]:
    """``track`` on a scene; the worker draws it itself."""
    drawn = _drawn(scene, seed, **parameters)
    return track(drawn.frames, drawn.extras["points"][0], scale, filters, others, seed)


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
    places = {
        name: places_of(tracker, later, RUNS_PER_SCENE, seed)
        for name, tracker in methods.trackers(frames[0], points, scale, filters).items()
    }
    if methods.FLOW in others:
        places[methods.FLOW] = follow_points(frames, points)[0][None]
    if methods.SPOT in others:
        places[methods.SPOT] = spot(frames, points)[None]
    if "not moving" in others:
        places["not moving"] = np.broadcast_to(points, (1, len(later), *points.shape))
    return places


def places_of(tracker: Any, later: Any, runs: int, seed: int) -> np.ndarray:
    """Positions ``[R, T, P, 2]`` estimated by a tracker in the frames after the first."""
    keys = jax.random.split(jax.random.key(seed), runs)
    return np.asarray(monte_carlo(tracker, keys, later, _estimate, batch_size=runs))


def _estimate(state: Any, summary: Any) -> Any:
    return summary.estimate
