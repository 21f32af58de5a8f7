"""Run all methods on a set of distracter scenes, for tables 1 and 2 and figure 4."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

import jaxpf
import scenes
from jaxpf import ordering
from jaxpf.boxes import tracker as box_tracker
from jaxpf.contract.interface import Tracker
from jaxpf.contract.state import Summary
from jaxpf.evaluation.work.worker import run_keys
from jaxpf.filters.partitioned.tracker import Partitioned
from jaxpf.lowering.programs import compiled
from jaxpf.measures import metrics, particle_sets
from jaxpf.ordering import Ordering
from jaxpf.papers.checkpoints import of_scenes
from jaxpf.papers.grid import Grid, stacked
from jaxpf.shapes.rectangles import boxes_from_substates

if TYPE_CHECKING:
    from jaxpf.papers.smith2004.conditions import OtherEnding
    from scenes import Scene

NUM_OBJECTS = 7
#: Lambda of the likelihood exp(-lambda d^2), the rows of tables 1 and 2.
SHARPNESS = (20.0, 30.0, 40.0, 50.0)

#: Scene parameters that the paper does not give; see ``settings.csv`` for how they were chosen.
SCENE: dict[str, Any] = {
    "object_width": 24,
    "object_height": 30,
    "likeness": 0.15,
    "lead_distance": 22.0,
    "leader_travel": 15.0,
    "departure": 55.0,
}

#: The paper has 50 runs on one scene.  We run once per scene: scenes differ more than runs.
RUNS_PER_SCENE = 1

METHODS = ("Non-PS", "PS", "DPS", "DPS evidence", "SPS")


def shifted(shift: int, num_objects: int = NUM_OBJECTS) -> list[int]:
    """The circular shift of 0..P-1 that begins with ``shift``."""
    return [(shift + k) % num_objects for k in range(num_objects)]


def all_orderings(num_objects: int = NUM_OBJECTS) -> dict[str, Ordering]:
    """Non-PS, PS in all circular shifts, DPS with both reassemblies, SPS: name -> ordering."""
    orders = [shifted(shift, num_objects) for shift in range(num_objects)]
    return {
        "Non-PS": ordering.sir(num_objects),
        **{order_name(order): ordering.ps(order) for order in orders},
        "DPS": ordering.dps(num_objects, reassembly="literal"),
        "DPS evidence": ordering.dps(num_objects),
        "SPS": ordering.sps(num_partitions=num_objects),
    }


def order_name(order: Sequence[int]) -> str:
    """``PS 2,3,1`` for the order 1, 2, 0; objects are counted from 1."""
    return "PS " + ",".join(str(partition + 1) for partition in order)


class Outcome(NamedTuple):
    """S scenes, O orderings, L sharpness values, R runs per scene, P objects.

    Attributes:
        names: names of the O orderings.
        recovered: ``[S, O, L, R]`` bool, object 1 was tracked in the last frame.
        success: ``[S, O, L]``, share of the runs and of objects 2 to P tracked throughout.
        precision: ``[S, O, L]``, mean over objects 2 to P and all frames.
        recall: as ``precision``.
        leader_precision: ``[S, O, L]``, for object 1, over the frames with T = 1.
        leader_recall: as ``leader_precision``.
        uniqueness: ``[S, O, L, P]``, mean over runs and frames.
        dynamics: ``[S, O, L, P, 2]``, effective dynamics in u and v: standard deviation of
            the particle set over the process noise.
    """

    names: tuple[str, ...]
    recovered: np.ndarray
    success: np.ndarray
    precision: np.ndarray
    recall: np.ndarray
    leader_precision: np.ndarray
    leader_recall: np.ndarray
    uniqueness: np.ndarray
    dynamics: np.ndarray

    def of(self, method: str) -> list[int]:
        """Indices of a method of ``METHODS``: all orders for "PS", one for the others."""
        if method != "PS":
            return [self.names.index(method)]
        return [place for place, name in enumerate(self.names) if name.startswith("PS ")]


def measure(
    seeds: Sequence[int],
    parameters: Mapping[str, Any] = SCENE,
    orderings: Mapping[str, Ordering] | None = None,
    sharpness: Sequence[float] = SHARPNESS,
    num_particles: int | None = None,
    report: Callable[[str], None] = lambda line: None,
    name: str = "distracter",
    ending: "OtherEnding | None" = None,
) -> Outcome:
    """Run every ordering and sharpness ``RUNS_PER_SCENE`` times on the scene of each seed.

    Args:
        seeds: S seeds of the scenes; a scene's seed also determines its runs, whose random numbers
            all orderings and sharpness values share.
        parameters: parameters of the distracter scene that differ from their defaults.
        orderings: name -> ordering; default ``all_orderings()``.
        sharpness: L values of lambda.
        num_particles: N; default the paper's 300.
        report: receives a line per scene.
        name: name under which scenes are stored; see ``jaxpf.papers.checkpoints``.
        ending: optional wrapper of the trackers; see ``OtherEnding``.
    """
    orderings = all_orderings() if orderings is None else orderings
    on_scene = partial(_on_scene, parameters, orderings, sharpness, num_particles, ending)
    found = of_scenes(name, on_scene, seeds, report, threads=jax.local_device_count())
    return Outcome(tuple(orderings), **found)


def _on_scene(
    parameters: Mapping[str, Any],
    orderings: Mapping[str, Ordering],
    sharpness: Sequence[float],
    num_particles: int | None,
    ending: "OtherEnding | None",
    seed: int,
) -> dict[str, Any]:
    """All fields of an ``Outcome`` except the names, for one scene."""
    scene = scenes.make("distracter", seed=seed, **parameters)
    tracker = scene_tracker(scene, num_particles=num_particles)
    recorded = jaxpf.monte_carlo(
        grid(tracker, orderings, sharpness, ending),
        run_keys(seed, 0, RUNS_PER_SCENE),
        scene.frames[1:],
        _record,
        batch_size=RUNS_PER_SCENE,
    )
    values = _measures(recorded, scene.boxes[1:], scene.sizes, tracker.dynamics.scale)
    return dict(zip(Outcome._fields[1:], values, strict=True))


def scene_tracker(
    scene: "Scene", ordering: Ordering | None = None, *, num_particles: int | None = None
) -> Partitioned:
    """The paper's tracker of a scene's patches; by default DPS with 300 particles.

    An integral histogram counts the pixels, whatever their number.
    """
    return box_tracker(
        scene.frames[0],
        scene.boxes[0],
        like="smith2004",
        patches=scene.patches,
        ordering=ordering,
        num_particles=num_particles,
    )


def grid(
    tracker: Partitioned,
    orderings: Mapping[str, Ordering],
    sharpness: Sequence[float],
    ending: "OtherEnding | None" = None,
) -> Grid:
    """Variants of a tracker: a row for each ordering, a column for each sharpness."""
    build = jax.tree_util.Partial(_built, tracker, ending)
    return Grid(build, stacked(orderings.values()), np.array(sharpness, np.float32))


def _built(
    tracker: Partitioned, ending: "OtherEnding | None", ordering: Ordering, sharpness: jax.Array
) -> Tracker:
    likelihood = dataclasses.replace(tracker.likelihood, sharpness=sharpness)
    tracker = dataclasses.replace(tracker, likelihood=likelihood, ordering=ordering)
    return tracker if ending is None else dataclasses.replace(ending, tracker=tracker)


def _record(state: object, summary: Summary) -> tuple[jax.Array, ...]:
    return summary.estimate, summary.distinct_share, summary.spread


@compiled
def _measures(
    recorded: tuple[jax.Array, ...], truth: jax.Array, sizes: jax.Array, noise: jax.Array
) -> tuple[jax.Array, ...]:
    """Compiled as a whole: a cold start would otherwise compile every operation separately."""
    # [R, T, O, L, ...] to [O, L, R, T, ...]
    estimate, uniqueness, spread = (jnp.moveaxis(x, (0, 1), (2, 3)) for x in recorded)
    boxes = boxes_from_substates(estimate, sizes)
    leader, others = boxes[..., :1, :], boxes[..., 1:, :]
    quality = (metrics.mean_precision, metrics.mean_recall)
    dynamics = particle_sets.effective_dynamics(spread, noise)
    return (
        metrics.recovery(leader, truth[:, :1])[..., 0],
        metrics.success(others, truth[:, 1:]).mean(axis=(-2, -1)),
        *(each(others, truth[:, 1:], over="all").mean(axis=(-2, -1)) for each in quality),
        *(each(leader, truth[:, :1], over="tracked", axis=(-3, -2))[..., 0] for each in quality),
        uniqueness.mean(axis=(2, 3)),
        dynamics[..., :2].mean(axis=(2, 3)),
    )
