"""Trackers of distracter scenes, and their runs: tables 1 and 2 and figure 4.

In the paper, the best order of PS recovers object 1 in 38% of the runs and the worst in 8%
(sharpness 30), and DPS in 13 to 23 points more than PS on average.  With the paper's settings we
observe neither.  ``PARTICLES`` and ``ENDINGS`` vary what the paper leaves open, to see whether such
an effect appears: a first stage with few particles may lose the last good copy; figure 1 of the
paper resamples at the start of a frame and after every stage, including the last, where this
library does both at once; estimates may be computed after that last resampling; and weights may not
be corrected for earlier stages, so that the joint likelihood at the end of the frame counts every
object twice except the last of the order, which alone is weighted correctly.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

import jaxpf
import scenes
from jaxpf import contract, ordering
from jaxpf.boxes import tracker as box_tracker
from jaxpf.contract.interface import Tracker
from jaxpf.contract.pytree import pytree_dataclass, static_field
from jaxpf.contract.state import ParticleState, Summary
from jaxpf.evaluation.engine import run_keys
from jaxpf.filters.partitioned.tracker import Partitioned
from jaxpf.lowering.programs import compiled
from jaxpf.measures import metrics, particle_sets
from jaxpf.ordering import Ordering
from jaxpf.papers.checkpoints import UNSTORED, Measurements
from jaxpf.papers.grid import Grid, stacked
from jaxpf.resampling.weighted import ancestors
from jaxpf.shapes.rectangles import boxes_from_substates
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
METHODS = ("Non-PS", "PS", "DPS", "DPS evidence", "SPS")
#: N as in the paper, and an N small enough that DPS loses its advantage.
PARTICLES = (300, 50)


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


@pytree_dataclass
class OtherEnding(contract.WrappedTracker):
    """A ``Partitioned`` whose frames end differently from the library's.

    Attributes:
        tracker: the ``Partitioned``, PS or DPS; None in ``ENDINGS``.
        counts_twice: static; multiply the weights by the likelihoods of all partitions but the last
            of the order, although resampling has used them already.
        draws_again: static; resample once more by the weights.
        reads_late: static; compute the estimate from the resampled particles.
    """

    tracker: Any = None
    counts_twice: bool = static_field(default=False)
    draws_again: bool = static_field(default=False)
    reads_late: bool = static_field(default=False)

    def step_observed(
        self, key: jax.Array, state: ParticleState, observation: Any
    ) -> tuple[ParticleState, Summary]:
        """A step of the tracker, and what follows it."""
        step_key, draw_key = jax.random.split(key)
        state, summary = self.tracker.step_observed(step_key, state, observation)
        estimate = summary.estimate
        if self.counts_twice:
            log_weights = state.log_weights + self._before_the_last(state, observation)
            weights = jax.nn.softmax(log_weights)
            state = dataclasses.replace(state, log_weights=jax.nn.log_softmax(log_weights))
            estimate = jnp.einsum("n,dpn->pd", weights, state.lagged[0])
        if self.draws_again:
            chosen = ancestors(draw_key, state.log_weights, "multinomial")
            state = dataclasses.replace(
                state,
                lagged=state.lagged[..., chosen],
                lineage=state.lineage[:, chosen],
                component=state.component[chosen],
                log_weights=jnp.full_like(state.log_weights, -np.log(len(chosen))),
            )
        if self.reads_late:
            estimate = state.lagged[0].mean(axis=-1).T
        return state, dataclasses.replace(summary, estimate=estimate)

    def _before_the_last(self, state: ParticleState, observation: Any) -> jax.Array:
        """Log-likelihoods ``[N]`` of each particle's partitions, except the last of its order."""
        last = self.tracker.ordering.order[state.component, -1]

        def of_partition(partition: jax.Array) -> jax.Array:
            every = jnp.full_like(last, partition)
            substates = state.lagged[0][:, partition]
            values = contract.log_prob_all(self.tracker.likelihood, observation, every, substates)
            return jnp.where(last == partition, 0.0, values)

        return jax.lax.map(of_partition, jnp.arange(self.tracker.num_partitions)).sum(axis=0)


#: How frames end: the library's way, then variants that change nothing else.
ENDINGS: Mapping[str, OtherEnding | None] = {
    "as here": None,
    "drawn twice": OtherEnding(draws_again=True),
    "drawn twice, read late": OtherEnding(draws_again=True, reads_late=True),
    "stages counted twice": OtherEnding(counts_twice=True),
}


class Outcome(NamedTuple):
    """S scenes, O orderings, L sharpness values, P objects.

    The paper has 50 runs on one scene.  We run once per scene: scenes differ more than runs.

    Attributes:
        names: names of the O orderings.
        recovered: ``[S, O, L]`` bool, object 1 was tracked in the last frame.
        success: ``[S, O, L]``, share of objects 2 to P tracked throughout.
        precision: ``[S, O, L]``, mean over objects 2 to P and all frames.
        recall: as ``precision``.
        leader_precision: ``[S, O, L]``, for object 1, over the frames with T = 1.
        leader_recall: as ``leader_precision``.
        uniqueness: ``[S, O, L, P]``, mean over frames.
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
    measurements: Measurements = UNSTORED,
    name: str = "distracter",
    ending: OtherEnding | None = None,
) -> Outcome:
    """Run every ordering and sharpness once on the scene of each seed.

    Args:
        seeds: S seeds of the scenes, and of the random numbers that all runs on a scene share.
        parameters: parameters of the distracter scene that differ from their defaults.
        orderings: name -> ordering; default ``all_orderings()``.
        sharpness: L values of lambda.
        num_particles: N; default the paper's 300.
        measurements: how scenes are measured.
        name: name under which scenes are stored; see ``jaxpf.papers.checkpoints``.
        ending: optional wrapper of the trackers; see ``OtherEnding``.
    """
    orderings = all_orderings() if orderings is None else orderings
    on_scene = partial(_on_scene, parameters, orderings, sharpness, num_particles, ending)
    found = measurements.of_scenes(name, on_scene, seeds, threads=jax.local_device_count())
    return Outcome(tuple(orderings), **found)


def measure_conditions(
    seeds: Sequence[int],
    num_particles: Sequence[int],
    endings: Sequence[str],
    measurements: Measurements = UNSTORED,
) -> dict[str, Outcome]:
    """Run PS and DPS under every condition, such as ``"N = 50, as here"``.

    Args:
        seeds: seeds of the scenes, at least two.
        num_particles: values of N.
        endings: keys of ``ENDINGS``.
        measurements: how scenes are measured.
    """
    chosen = {n: o for n, o in all_orderings().items() if n.startswith("PS ") or n == "DPS"}
    return {
        (name := f"N = {count}, {ending}"): measure(
            seeds,
            orderings=chosen,
            num_particles=count,
            ending=ENDINGS[ending],
            name=name,
            measurements=measurements,
        )
        for count in num_particles
        for ending in endings
    }


def _on_scene(
    parameters: Mapping[str, Any],
    orderings: Mapping[str, Ordering],
    sharpness: Sequence[float],
    num_particles: int | None,
    ending: OtherEnding | None,
    seed: int,
) -> dict[str, Any]:
    """All fields of an ``Outcome`` except the names, for one scene."""
    scene = scenes.make("distracter", seed=seed, **parameters)
    tracker = scene_tracker(scene, num_particles=num_particles)
    recorded = jaxpf.monte_carlo(
        grid(tracker, orderings, sharpness, ending),
        run_keys(seed, 0, 1),
        scene.frames[1:],
        _record,
        batch_size=1,
    )
    dynamics: Any = tracker.dynamics
    return _measures(recorded, scene.boxes[1:], scene.sizes, dynamics.scale)


def scene_tracker(
    scene: Scene, ordering: Ordering | None = None, *, num_particles: int | None = None
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
    ending: OtherEnding | None = None,
) -> Grid:
    """Variants of a tracker: a row for each ordering, a column for each sharpness."""
    build = jax.tree_util.Partial(_built, tracker, ending)
    return Grid(build, stacked(orderings.values()), np.array(sharpness, np.float32))


def _built(
    tracker: Partitioned, ending: OtherEnding | None, ordering: Ordering, sharpness: jax.Array
) -> Tracker:
    likelihood: Any = tracker.likelihood
    likelihood = dataclasses.replace(likelihood, sharpness=sharpness)
    tracker = dataclasses.replace(tracker, likelihood=likelihood, ordering=ordering)
    return tracker if ending is None else dataclasses.replace(ending, tracker=tracker)


def _record(state: object, summary: Summary) -> tuple[jax.Array, ...]:
    return summary.estimate, summary.distinct_share, summary.spread


@compiled
def _measures(
    recorded: tuple[jax.Array, ...], truth: jax.Array, sizes: jax.Array, noise: jax.Array
) -> dict[str, jax.Array]:
    """Compiled as a whole: a cold start would otherwise compile every operation separately."""
    # Of the only run, [T, O, L, ...] to [O, L, T, ...]
    estimate, uniqueness, spread = (jnp.moveaxis(x[0], 0, 2) for x in recorded)
    found = metrics.measure_boxes(boxes_from_substates(estimate, sizes), truth)
    leader = {name: each[..., :1] for name, each in found.items()}
    others = {name: each[..., 1:] for name, each in found.items()}
    values = {
        "recovered": metrics.in_the_end(leader["tracked"], leader["present"])[..., 0],
        "success": metrics.throughout(others["tracked"], others["present"]).mean(axis=-1),
        "uniqueness": uniqueness.mean(axis=2),
        "dynamics": particle_sets.effective_dynamics(spread, noise)[..., :2].mean(axis=2),
    }
    for name in ("precision", "recall"):
        by_object = metrics.masked_mean(others[name], others["present"], -2)
        values[name] = by_object.mean(axis=-1)
        values[f"leader_{name}"] = metrics.masked_mean(leader[name], leader["tracked"], -2)[..., 0]
    return values
