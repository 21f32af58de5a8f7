"""PS and SPS on sequences of articulated objects, under both dynamics."""

import dataclasses
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import jaxpf
import scenes
from jaxpf.contract.state import Summary
from jaxpf.contract.types import DynamicsLike
from jaxpf.filters.partitioned.tracker import Partitioned
from jaxpf.likelihoods.histogram import HistogramLikelihood, histogram_from_patches
from jaxpf.lowering.programs import compiled
from jaxpf.measures import particle_sets
from jaxpf.ordering import Ordering, named
from jaxpf.papers.checkpoints import UNSTORED, Measurements
from jaxpf.papers.grid import Grid, stacked
from jaxpf.parts.models import parts_model
from jaxpf.shapes.rectangles import corners_from_poses
from jaxpf.targets.presets import GONZALES2011_REACH, GONZALES2011_SHARPNESS
from scenes import Scene

#: Motion -> how many times as many sequences: the error under erratic motion varies most.
MORE = {"erratic": 2}
#: Samples per side of a part: d^2 has an error of .017 (standard deviation), the log-likelihood .8.
SAMPLES = 10
DYNAMICS = ("absolute", "relative")
#: Swap of each method: the paper's baseline, its method, and two variants for comparison.
SWAPS = {
    "PS": None,
    "SPS sorted": "sorted",
    "SPS combinatorial": "combinatorial",
    "SPS without swap": "none",
}
METHODS = tuple(SWAPS)
#: Method and dynamics -> their place in a ``grid``.
VARIANTS = {
    f"{method}, {kind}": (row, column)
    for row, method in enumerate(METHODS)
    for column, kind in enumerate(DYNAMICS)
}
#: Motion -> process noise per frame, (pixels, pixels, radians): of every part of the absolute
#: random walk, of the root of the relative dynamics, and of a joint's offset and angle.  The noise
#: of the paper "has been manually chosen"; for ours see ``settings.csv``.
NOISE = {
    "smooth": {"absolute": (4, 4, 0.12), "root": (3, 3, 0.08), "joint": (0.5, 0.5, 0.08)},
    "strong_start": {"absolute": (6, 6, 0.06), "root": (6, 6, 0.15), "joint": (0.5, 0.5, 0.15)},
    "erratic": {"absolute": (9, 9, 0.06), "root": (6, 6, 0.15), "joint": (0.5, 0.5, 0.15)},
}
#: (motion, parts, particles) -> ("error" or "variance", variant) -> ``[S, T]``: the sum of corner
#: distances in pixels, or the variance of the particle set in pixels^2.
Curves = Mapping[tuple[str, int, int], Mapping[tuple[str, str], np.ndarray]]


def measure(
    cells: Sequence[tuple[str, int, tuple[int, ...]]],
    seeds: range,
    num_frames: int,
    measurements: Measurements = UNSTORED,
) -> Curves:
    """Track the sequences of every cell once with every method.

    Args:
        cells: motion and number of parts of their own sequences, and numbers of particles.
        seeds: seeds of the sequences, and of the run of all methods; more follow for ``MORE``.
        num_frames: frames per sequence; the trackers start at the first.
        measurements: how scenes are measured.
    """
    curves = {}
    for motion, num_parts, particles in cells:
        on_scene = partial(_on_scene, motion, num_parts, particles, num_frames)
        chosen = range(seeds.start, seeds.start + MORE.get(motion, 1) * len(seeds))
        # Two threads: one compiles while the other tracks.
        found = measurements.of_scenes(f"{motion}-{num_parts}-parts", on_scene, chosen, threads=2)
        for place, number in enumerate(particles):
            curves[motion, num_parts, number] = {
                (field, variant): values[:, place, row, column]
                for field, values in found.items()
                for variant, (row, column) in VARIANTS.items()
            }
    return curves


def _on_scene(
    motion: str, num_parts: int, particles: Sequence[int], num_frames: int, seed: int
) -> dict[str, Any]:
    """Errors and variances ``[N, M, K, T]`` of one sequence, by number of particles, method and
    dynamics.
    """
    scene = scenes.make(
        "articulated", seed, num_parts=num_parts, motion=motion, num_frames=num_frames
    )
    truth, errors, variances = scene.extras["corners"][1:], [], []
    for number in particles:
        recorded = _track(grid(scene, motion, number), jax.random.key(seed), scene.frames[1:])
        poses, spread = (np.moveaxis(np.asarray(each)[0], 0, 2) for each in recorded)
        corners = corners_from_poses(poses, scene.sizes)
        errors.append(particle_sets.corner_distances(corners, truth))
        variances.append(particle_sets.pose_variance(spread, scene.sizes))
    return {"error": errors, "variance": variances}


# Eighteen kernels are compiled for few particles each: here compile time matters more than the
# speed of the code.
@partial(compiled, compiler_options={"xla_backend_optimization_level": 1})
def _track(tracker: Grid, key: jax.Array, frames: jax.Array) -> tuple[jax.Array, ...]:
    """Estimates and spreads of the poses, ``[1, T, M, K, P, 3]``."""
    return jaxpf.monte_carlo(tracker, key[None], frames, _record, batch_size=1)


def _record(state: object, summary: Summary) -> tuple[jax.Array, ...]:
    return summary.estimate[..., :3], summary.spread[..., :3]


def grid(scene: Scene, motion: str, num_particles: int) -> Grid:
    """All trackers of a scene: a row for each of ``METHODS``, a column for each of ``DYNAMICS``."""
    parents, noise = scene.extras["parents"], NOISE[motion]
    model = parts_model(
        learn(scene),
        scene.extras["poses"][0],
        scene.sizes,
        parents,
        scale=noise["root"],
        joint_scale=noise["joint"],
        anchors=(scene.extras["parent_anchors"], scene.extras["part_anchors"]),
        reach=GONZALES2011_REACH,
    )
    orderings = [
        named("ps", parents) if swap is None else named("sps", parents, swap=swap)
        for swap in SWAPS.values()
    ]
    tracker = Partitioned(
        **model._asdict(),
        ordering=orderings[0],
        num_particles=num_particles,
        resampling="multinomial",
    )
    alone, absolute = np.array(parents) < 0, np.array(noise["absolute"], np.float32)
    moves: Any = tracker.dynamics
    dynamics = [
        dataclasses.replace(
            moves, scale=absolute, joint_scale=absolute, walks_alone=np.ones_like(alone)
        ),
        dataclasses.replace(moves, walks_alone=alone),
    ]
    return Grid(jax.tree_util.Partial(_built, tracker), stacked(orderings), stacked(dynamics))


def _built(tracker: Partitioned, ordering: Ordering, dynamics: DynamicsLike) -> Partitioned:
    initial = dataclasses.replace(tracker.initial, dynamics=dynamics)
    return dataclasses.replace(tracker, ordering=ordering, dynamics=dynamics, initial=initial)


def learn(scene: Scene) -> HistogramLikelihood:
    """Learn the likelihood of the scene's parts: one histogram per part, as in the paper."""
    likelihood = histogram_from_patches(
        scene.patches,
        scene.sizes,
        sharpness=GONZALES2011_SHARPNESS,
        bands=1,
        method="sampled",
        samples=SAMPLES,
    )
    # Scenes have different textures, and so different numbers of occupied bins.
    return _padded(likelihood, num_bins=112, num_levels=16)


def _padded(likelihood: HistogramLikelihood, num_bins: int, num_levels: int) -> HistogramLikelihood:
    """The same likelihood in arrays of a fixed shape, so that all scenes share a kernel."""
    used = likelihood.references.shape[-1]
    more_levels = max(num_levels - likelihood.levels.shape[-1], 0)
    levels = jnp.pad(likelihood.levels, ((0, 0), (0, 0), (0, more_levels)), constant_values=used)
    return dataclasses.replace(
        likelihood,
        references=jnp.pad(likelihood.references, ((0, 0), (0, 0), (0, num_bins - used))),
        bin_lookup=jnp.where(likelihood.bin_lookup == used, num_bins, likelihood.bin_lookup),
        levels=jnp.where(levels == used, num_bins, levels),
    )
