"""PS and SPS on sequences of articulated objects, under both dynamics."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import Mesh, NamedSharding, PartitionSpec

import scenes
from jaxpf.contract.pytree import pytree_dataclass
from jaxpf.filters.partitioned.tracker import Partitioned
from jaxpf.likelihoods.histogram import HistogramLikelihood, histogram_from_patches
from jaxpf.likelihoods.wrapped import WrappedLikelihood
from jaxpf.measures import particle_sets
from jaxpf.ordering import named
from jaxpf.papers.checkpoints import each
from jaxpf.papers.gonzales2011.published import SHARPNESS
from jaxpf.parts.models import OfFixedSize, parts_model
from jaxpf.running import run
from jaxpf.shapes.rectangles import corners_from_poses

#: Runs per sequence; intervals are over sequences.
RUNS_PER_SCENE = 1
#: Number of sequences tracked together.
_TOGETHER = 10
#: Samples per side of a part: d^2 has an error of .017 (standard deviation), the log-likelihood .8.
SAMPLES = 10

DYNAMICS = ("absolute", "relative")
#: The paper's baseline, its method with the paper's swap, and two variants for comparison.
METHODS = ("PS", "SPS sorted", "SPS combinatorial", "SPS without swap")
SWAPS = dict(zip(METHODS[1:], ("sorted", "combinatorial", "none"), strict=True))

_SCENES = "scenes"
#: Range of the initial particles around the object: pixels, pixels, radians (our choice).
REACH = (5.0, 5.0, 0.1)


class Noise(NamedTuple):
    """Process noise per frame: pixels and radians.

    The paper's noise "has been manually chosen".  Ours minimises the error of PS for 7 parts and 20
    particles on a sequence with another seed (1000) than the reported ones.

    Attributes:
        absolute: for x, y and for theta, for every part of the absolute random walk.
        root: for x, y and for theta, for the root of the relative dynamics.
        joint: for a joint's offset (x and y) and for its angle.
    """

    absolute: tuple[float, float]
    root: tuple[float, float]
    joint: tuple[float, float] = (0.5, 0.1)


NOISE = {
    "smooth": Noise(absolute=(4.0, 0.12), root=(3.0, 0.08), joint=(0.5, 0.08)),
    "strong_start": Noise(absolute=(6.0, 0.06), root=(6.0, 0.15), joint=(0.5, 0.15)),
    "erratic": Noise(absolute=(9.0, 0.06), root=(6.0, 0.15), joint=(0.5, 0.15)),
}


@pytree_dataclass
class Observed(WrappedLikelihood):
    """A likelihood whose frames were observed in advance, once for all trackers.

    Attributes:
        likelihood: the likelihood that observed them.
    """

    likelihood: Any

    def observe(self, frame):
        """Return the frame, which is already an observation."""
        return frame


class Outcome(NamedTuple):
    """Runs of the methods on S sequences of T frames.

    Attributes:
        error: (dynamics, method) -> sum of corner distances, pixels, ``[S, R, T]``.
        variance: (dynamics, method) -> variance of the particle set, pixels^2, ``[S, R, T]``.
    """

    error: dict[tuple[str, str], np.ndarray]
    variance: dict[tuple[str, str], np.ndarray]


#: (motion, parts, particles) -> outcome.
Outcomes = Mapping[tuple[str, int, int], Outcome]


class Cell(NamedTuple):
    """One experiment: a motion, a number of parts, and numbers of particles.

    Attributes:
        motion: motion of the scene ``articulated``.
        num_parts: P.
        particles: values of N.
    """

    motion: str
    num_parts: int
    particles: tuple[int, ...]


def measure(
    cells: Sequence[Cell],
    seeds: Sequence[int],
    num_frames: int,
    dynamics: Sequence[str] = DYNAMICS,
    progress: Callable[[str], None] = lambda line: None,
) -> Outcomes:
    """Track the sequences of every cell with every method.

    Args:
        cells: each has its own sequences.
        seeds: seeds of the sequences; run r on sequence s has the seed ``s * RUNS_PER_SCENE + r``
            for all methods.
        num_frames: frames per sequence; the trackers start at the first.
        dynamics: a selection of ``DYNAMICS``.
        progress: receives a line per cell and block of sequences.
    """

    def by_method(values: Mapping[str, Mapping[str, np.ndarray]]) -> dict:
        return {(kind, method): values[kind][method] for kind in dynamics for method in METHODS}

    # Blocks are the outer loop: blocks of one cell share a kernel, which is compiled once.
    blocks = [seeds[first : first + _TOGETHER] for first in range(0, len(seeds), _TOGETHER)]
    parts = [
        (
            f"{cell.motion}-{cell.num_parts}-{block[0]}-{len(block)}",
            partial(_measured, cell, block, num_frames, dynamics),
        )
        for block in blocks
        for cell in cells
    ]
    # Two threads: one compiles while the other tracks.
    measured = each(parts, threads=2)
    by_cell: dict[Cell, list[Any]] = {cell: [] for cell in cells}
    for block in blocks:
        for cell in cells:
            by_cell[cell].append(next(measured))
            progress(
                f"  {cell.motion}, {cell.num_parts} parts: sequences {block[0]} to {block[-1]} done"
            )
    outcomes = {}
    for cell, blocks_of_cell in by_cell.items():
        joined = jax.tree.map(lambda *rows: np.concatenate(rows), *blocks_of_cell)
        for number in cell.particles:
            values = joined[str(number)]
            outcomes[cell.motion, cell.num_parts, number] = Outcome(
                *(by_method(values[what]) for what in Outcome._fields)
            )
    return outcomes


def _measured(
    cell: Cell, seeds: Sequence[int], num_frames: int, dynamics: Sequence[str]
) -> dict[str, dict[str, dict[str, dict[str, np.ndarray]]]]:
    """Number of particles -> error or variance -> dynamics -> method -> ``[S, R, T]``."""
    motion, num_parts, particles = cell
    sequences, likelihoods, observed = [], [], []
    for seed in seeds:
        scene = scenes.make(
            "articulated", seed, num_parts=num_parts, motion=motion, num_frames=num_frames
        )
        likelihoods.append(learn(scene))
        observed.append(np.asarray(_observe(likelihoods[-1], scene.frames[1:])))
        # The images take most of a scene's memory and are no longer needed.
        rest = dataclasses.replace(scene, frames=scene.frames[:1].copy(), boxes=scene.boxes[:1])
        sequences.append(rest)
    mesh = _mesh(len(sequences))
    frames = jax.device_put(np.stack(observed), NamedSharding(mesh, PartitionSpec(_SCENES)))
    del observed
    likelihood = _stacked(likelihoods)
    truth = np.stack([scene.extras["corners"][1:] for scene in sequences])[:, None]
    sizes = sequences[0].sizes
    keys = jnp.stack(
        [
            jnp.stack([jax.random.key(seed * RUNS_PER_SCENE + r) for r in range(RUNS_PER_SCENE)])
            for seed in seeds
        ]
    )
    outcomes = {}
    for num_particles in particles:
        by_scene = [
            trackers(scene, Observed(likelihood), motion, num_particles, dynamics)
            for scene, likelihood in zip(sequences, likelihoods, strict=True)
        ]
        errors: dict[str, dict[str, np.ndarray]] = {kind: {} for kind in dynamics}
        variances: dict[str, dict[str, np.ndarray]] = {kind: {} for kind in dynamics}
        for method in METHODS:
            moves = _stacked(
                [
                    _stacked([of_scene[kind, method].dynamics for of_scene in by_scene])
                    for kind in dynamics
                ]
            )
            starts = _stacked(
                [
                    _stacked([of_scene[kind, method].initial for of_scene in by_scene])
                    for kind in dynamics
                ]
            )
            base = by_scene[0][dynamics[0], method]
            # Move results off the devices: a joint operation on device arrays would wait for
            # another thread's program, which holds one device and waits for the other (a deadlock).
            poses, spread = jax.device_get(
                _track(base, moves, starts, OfFixedSize(Observed(likelihood)), keys, frames, mesh)
            )
            error = particle_sets.corner_distances(corners_from_poses(poses, sizes), truth)
            variance = particle_sets.pose_variance(spread, sizes)
            for number, kind in enumerate(dynamics):
                errors[kind][method] = np.asarray(error[number])
                variances[kind][method] = np.asarray(variance[number])
        outcomes[str(num_particles)] = {"error": errors, "variance": variances}
    return outcomes


def trackers(
    scene: Any, likelihood: Any, motion: str, num_particles: int, dynamics: Sequence[str] = DYNAMICS
) -> dict[tuple[str, str], Partitioned]:
    """(dynamics, method) -> tracker; all trackers share one compiled kernel."""
    parents, noise = scene.extras["parents"], NOISE[motion]
    model = parts_model(
        likelihood,
        scene.extras["poses"][0],
        scene.sizes,
        parents,
        scale=_both(noise.root),
        joint_scale=_both(noise.joint),
        anchors=(scene.extras["parent_anchors"], scene.extras["part_anchors"]),
        reach=REACH,
    )
    base = Partitioned(
        **model._asdict(),
        ordering=named("ps", parents),
        num_particles=num_particles,
        resampling="multinomial",
    )
    alone = np.array(parents) < 0
    absolute = np.array(_both(noise.absolute), np.float32)
    scales = {
        "absolute": (absolute, absolute),
        "relative": (base.dynamics.scale, base.dynamics.joint_scale),
    }
    by_kind = {}
    for kind in dynamics:
        moves = dataclasses.replace(
            base.dynamics,
            scale=scales[kind][0],
            joint_scale=scales[kind][1],
            walks_alone=np.ones_like(alone) if kind == "absolute" else alone,
        )
        initial = dataclasses.replace(base.initial, dynamics=moves)
        for method in METHODS:
            ordering = base.ordering
            if method != "PS":
                ordering = named("sps", parents, swap=SWAPS[method])
            by_kind[kind, method] = dataclasses.replace(
                base, dynamics=moves, initial=initial, ordering=ordering
            )
    return by_kind


def learn(scene: Any, samples: int = SAMPLES) -> HistogramLikelihood:
    """Learn the likelihood of the scene's parts: one histogram per part, as in the paper."""
    likelihood = histogram_from_patches(
        scene.patches,
        scene.sizes,
        sharpness=SHARPNESS,
        parts=1,
        method="sampled",
        samples=samples,
    )
    # Scenes have different textures, and so different numbers of occupied bins.
    return _padded(likelihood, num_bins=112, num_levels=16)


def _both(noise: tuple[float, float]) -> tuple[float, float, float]:
    return noise[0], noise[0], noise[1]


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


def _keep_poses(state: Any, summary: Any) -> Any:
    return summary.estimate[:, :3], summary.spread[:, :3]


def _mesh(num_scenes: int) -> Mesh:
    """Mesh of the largest number of devices that divides the sequences evenly."""
    devices = jax.local_devices()
    used = max(n for n in range(1, len(devices) + 1) if num_scenes % n == 0)
    return Mesh(np.asarray(devices[:used]), (_SCENES,))


def _stacked(trees: Sequence[Any]) -> Any:
    return jax.tree.map(lambda *leaves: jnp.stack([jnp.asarray(x) for x in leaves]), *trees)


# Eighteen kernels are compiled for few particles each: here compile time matters more than the
# speed of the code, which table 1 measures separately.
@partial(jax.jit, static_argnames="mesh", compiler_options={"xla_backend_optimization_level": 1})
def _track(base, dynamics, initial, likelihood, keys, frames, mesh):
    """Track all runs on all sequences under all dynamics together.

    With few particles a processor idles between small operations; running side by side fills the
    gaps.  Sequences are distributed over the devices.

    Args:
        base: tracker whose ordering, traced but not batched, is shared by all runs.
        dynamics: stacked ``[K, S, ...]``: kinds of dynamics, sequences.
        initial: stacked ``[K, S, ...]``.
        likelihood: stacked ``[S, ...]``.
        keys: ``[S, R]``.
        frames: observations, ``[S, T, ...]``.
        mesh: devices that share the sequences.

    Returns:
        Estimates and spreads of the poses, ``[K, S, R, T, P, 3]``.
    """

    def track(dynamics, initial, likelihood, key, frames):
        tracker = dataclasses.replace(
            base, dynamics=dynamics, initial=initial, likelihood=likelihood
        )
        return run(tracker, key, frames, _keep_poses)[1]

    by_run = jax.vmap(track, in_axes=(None, None, None, 0, None))
    by_scene = jax.vmap(by_run)
    by_kind = jax.vmap(by_scene, in_axes=(0, 0, None, None, None))
    scene, kind_and_scene = PartitionSpec(_SCENES), PartitionSpec(None, _SCENES)
    return jax.shard_map(
        by_kind,
        mesh=mesh,
        in_specs=(kind_and_scene, kind_and_scene, scene, scene, scene),
        out_specs=kind_and_scene,
        check_vma=False,
    )(dynamics, initial, likelihood, keys, frames)


@jax.jit
def _observe(likelihood, frames):
    return jax.lax.map(likelihood.observe, frames)
