"""PS and SPS on sequences of articulated objects, under both dynamics."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

import jaxpf
import scenes
from jaxpf.filters.partitioned.tracker import Partitioned
from jaxpf.likelihoods.histogram import HistogramLikelihood, histogram_from_patches
from jaxpf.lowering.programs import compiled
from jaxpf.measures import particle_sets
from jaxpf.ordering import Ordering, named
from jaxpf.papers.checkpoints import of_scenes
from jaxpf.papers.gonzales2011 import published
from jaxpf.papers.grid import Grid, stacked
from jaxpf.papers.judging.claims import counted
from jaxpf.papers.paper import Request
from jaxpf.parts.models import parts_model
from jaxpf.shapes.rectangles import corners_from_poses

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
#: Method and dynamics -> their place in an ``Outcome``.
VARIANTS = {
    f"{method}, {kind}": (row, column)
    for row, method in enumerate(METHODS)
    for column, kind in enumerate(DYNAMICS)
}
#: Range of the initial particles around the object: pixels, pixels, radians (our choice).
REACH = (5.0, 5.0, 0.1)


#: Motion -> process noise per frame, (pixels, radians): of every part of the absolute random walk,
#: of the root of the relative dynamics, and of a joint's offset and angle.  The paper's noise "has
#: been manually chosen"; for ours see ``settings.csv``.
NOISE = {
    "smooth": {"absolute": (4.0, 0.12), "root": (3.0, 0.08), "joint": (0.5, 0.08)},
    "strong_start": {"absolute": (6.0, 0.06), "root": (6.0, 0.15), "joint": (0.5, 0.15)},
    "erratic": {"absolute": (9.0, 0.06), "root": (6.0, 0.15), "joint": (0.5, 0.15)},
}


class Outcome(NamedTuple):
    """Runs of M methods under K dynamics on S sequences of T frames.

    Attributes:
        error: sum of corner distances, pixels, ``[S, M, K, T]``.
        variance: variance of the particle set, pixels^2, ``[S, M, K, T]``.
    """

    error: np.ndarray
    variance: np.ndarray

    def of(self, field: str, variant: str) -> np.ndarray:
        """``[S, T]``, a field of one of ``VARIANTS``."""
        row, column = VARIANTS[variant]
        return getattr(self, field)[:, row, column]


#: (motion, parts, particles) -> outcome.
Outcomes = Mapping[tuple[str, int, int], Outcome]


def measure_all(request: Request) -> Outcomes:
    """Run all measurements; the quick ones are of fewer cells and frames."""
    erratic = "erratic", published.FIGURE_11_PARTS, (published.FIGURE_11_PARTICLES,)
    request.report(f"{counted(len(request.seeds), 'sequences')}, one run of 8 trackers on each")
    if request.quick:
        return measure([("smooth", 5, (5, 10)), erratic], request.seeds, 40, request.report)
    smooth = [("smooth", p, published.FIGURE_8_PARTICLES) for p in published.FIGURE_8_PARTS]
    strong = [("strong_start", p, (published.FIGURE_10_PARTICLES,)) for p in published.PARTS]
    cells = [*smooth, *strong, erratic]
    return measure(cells, request.seeds, published.FRAMES, request.report)


def measure(
    cells: Sequence[tuple[str, int, tuple[int, ...]]],
    seeds: Sequence[int],
    num_frames: int,
    report: Callable[[str], None] = lambda line: None,
) -> Outcomes:
    """Track the sequences of every cell once with every method.

    Args:
        cells: motion and number of parts of their own sequences, and numbers of particles.
        seeds: seeds of the sequences, and of the run of all methods.
        num_frames: frames per sequence; the trackers start at the first.
        report: receives a line per sequence.
    """
    outcomes = {}
    for motion, num_parts, particles in cells:
        on_scene = partial(_on_scene, motion, num_parts, particles, num_frames)
        # Two threads: one compiles while the other tracks.
        found = of_scenes(f"{motion}-{num_parts}-parts", on_scene, seeds, report, threads=2)
        for place, number in enumerate(particles):
            fields = {name: values[:, place] for name, values in found.items()}
            outcomes[motion, num_parts, number] = Outcome(**fields)
    return outcomes


def _on_scene(
    motion: str, num_parts: int, particles: Sequence[int], num_frames: int, seed: int
) -> dict[str, Any]:
    """Fields of an ``Outcome`` of one sequence, for each number of particles."""
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
def _track(tracker: Grid, key: jax.Array, frames: jax.Array) -> Any:
    """Estimates and spreads of the poses, ``[1, T, M, K, P, 3]``."""
    return jaxpf.monte_carlo(tracker, key[None], frames, _record, batch_size=1)


def _record(state: Any, summary: Any) -> Any:
    return summary.estimate[..., :3], summary.spread[..., :3]


def grid(scene: Any, motion: str, num_particles: int) -> Grid:
    """All trackers of a scene: a row for each of ``METHODS``, a column for each of ``DYNAMICS``."""
    parents, noise = scene.extras["parents"], NOISE[motion]
    model = parts_model(
        learn(scene),
        scene.extras["poses"][0],
        scene.sizes,
        parents,
        scale=_both(noise["root"]),
        joint_scale=_both(noise["joint"]),
        anchors=(scene.extras["parent_anchors"], scene.extras["part_anchors"]),
        reach=REACH,
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
    alone, absolute = np.array(parents) < 0, np.array(_both(noise["absolute"]), np.float32)
    moves: Any = tracker.dynamics
    dynamics = [
        dataclasses.replace(
            moves, scale=absolute, joint_scale=absolute, walks_alone=np.ones_like(alone)
        ),
        dataclasses.replace(moves, walks_alone=alone),
    ]
    return Grid(jax.tree_util.Partial(_built, tracker), stacked(orderings), stacked(dynamics))


def _built(tracker: Any, ordering: Ordering, dynamics: Any) -> Partitioned:
    initial = dataclasses.replace(tracker.initial, dynamics=dynamics)
    return dataclasses.replace(tracker, ordering=ordering, dynamics=dynamics, initial=initial)


def learn(scene: Any, samples: int = SAMPLES) -> HistogramLikelihood:
    """Learn the likelihood of the scene's parts: one histogram per part, as in the paper."""
    likelihood = histogram_from_patches(
        scene.patches,
        scene.sizes,
        sharpness=published.SHARPNESS,
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
