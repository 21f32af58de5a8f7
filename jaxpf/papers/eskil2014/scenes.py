"""The runs behind the tables: all methods on a set of scenes, or on one clip."""

import functools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

import scenes
from jaxpf.evaluation.baselines.optical_flow import follow_points
from jaxpf.evaluation.baselines.spot import spot
from jaxpf.measures import points as measures
from jaxpf.papers.eskil2014 import methods
from jaxpf.papers.measuring.checkpoints import Measure, each
from jaxpf.running.blocks import monte_carlo

#: The paper has one film of each kind; here runs are spread over scenes, the intervals' units.
RUNS_PER_SCENE = 5
#: Runs that are vectorised together.
TOGETHER = 5
#: SPOT takes about half a second for a frame: it is run on a share of the scenes only.
SPOT_SHARE = 0.3


class Outcome(NamedTuple):
    """S scenes of one kind, R runs on each (1 of a deterministic method), T frames, P points.

    Attributes:
        scene: name of the kind.
        names: of the points.
        errors: method -> ``[S, R, T, P]``, distances over the body's length; of SPOT the first
            scenes only.
        visible: ``[S, T, P]`` bool.
    """

    scene: str
    names: tuple[str, ...]
    errors: Mapping[str, np.ndarray]
    visible: np.ndarray


def spot_scenes(number: int) -> int:
    """Of so many scenes, those that SPOT is run on: a share, and at least three."""
    return min(max(3, math.ceil(SPOT_SHARE * number)), number)


def measure(
    scene: str,
    scale: float,
    seeds: Sequence[int],
    filters: Sequence[str] = methods.FILTERS,
    others: Sequence[str] = methods.OTHERS,
    runs: int = RUNS_PER_SCENE,
    report: Callable[[str], None] = print,
    **parameters: Any,
) -> Outcome:
    """Track the scenes of the seeds by all methods.

    Args:
        scene: name of a scene of points.
        scale: sigma_t, pixels.
        seeds: of the scenes, S.
        filters: of ``methods.FILTERS``.
        others: of ``methods.OTHERS``.
        runs: on every scene, R.
        report: takes a line of progress.
        parameters: of the scene, where they differ from its defaults.
    """
    errors: dict[str, list[np.ndarray]] = {}
    visible, names = [], ()
    fewer = [name for name in others if name != methods.SPOT]
    by_spot = seeds[: spot_scenes(len(seeds))] if methods.SPOT in others else ()

    def parts() -> Iterator[tuple[str, Measure]]:
        for seed in seeds:
            on_scene = functools.partial(_on_scene, scene, seed, parameters, scale, runs)
            yield f"{scene}-{seed}", functools.partial(on_scene, filters, fewer)
            if seed in by_spot:
                # Apart: the more scenes, the more of them SPOT is run on.
                yield f"{scene}-{seed}-spot", functools.partial(on_scene, (), [methods.SPOT])

    tracked = each(parts())
    for done, seed in enumerate(seeds, start=1):
        found = next(tracked) | (next(tracked) if seed in by_spot else {})
        drawn = _drawn(scene, seed, **parameters)
        truth, names = drawn.extras["points"], drawn.extras["point_names"]
        for method, places in found.items():
            distance = measures.point_distances(places, truth[1:], drawn.extras["body_length"][1:])
            errors.setdefault(method, []).append(distance)
        visible.append(drawn.extras["visible"][1:])
        report(f"  {scene}: scene {done} of {len(seeds)} done")
    stacked = {method: np.stack(each) for method, each in errors.items()}
    return Outcome(scene, tuple(names), stacked, np.stack(visible))


@functools.lru_cache(maxsize=1)  # it is asked for to be tracked, and again to be judged
def _drawn(scene: str, seed: int, **parameters: Any) -> scenes.Scene:
    return scenes.make(scene, seed=seed, **parameters)


def _on_scene(
    scene: str,
    seed: int,
    parameters: Mapping[str, Any],
    scale: float,
    runs: int,
    filters: Sequence[str],
    others: Sequence[str],
) -> dict[str, np.ndarray]:
    """``track`` on a scene that is drawn where the work is done."""
    drawn = _drawn(scene, seed, **parameters)
    return track(drawn.frames, drawn.extras["points"][0], scale, filters, others, runs, seed)


def track(
    frames: np.ndarray,
    points: np.ndarray,
    scale: float,
    filters: Sequence[str],
    others: Sequence[str],
    runs: int,
    seed: int,
) -> dict[str, np.ndarray]:
    """Method -> places ``[R, T, P, 2]`` in the frames after the first, in which points start."""
    later = jnp.asarray(frames[1:])
    found = {
        name: places_of(tracker, later, runs, seed)
        for name, tracker in methods.trackers(frames[0], points, scale, filters).items()
    }
    if methods.SPOT in others:
        found[methods.SPOT] = spot(frames, points)[None]
    if methods.FLOW in others:
        found[methods.FLOW] = follow_points(frames, points)[0][None]
    if "not moving" in others:
        found["not moving"] = np.broadcast_to(points, (1, len(later), *points.shape))
    return found


def places_of(tracker: Any, later: Any, runs: int, seed: int) -> np.ndarray:
    """Places ``[R, T, P, 2]`` that a tracker finds in the frames after the first."""
    keys = jax.random.split(jax.random.key(seed), runs)
    return np.asarray(monte_carlo(tracker, keys, later, _estimate, batch_size=min(runs, TOGETHER)))


def _estimate(state: Any, summary: Any) -> Any:
    return summary.estimate
