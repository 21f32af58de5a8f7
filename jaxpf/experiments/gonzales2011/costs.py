"""What a particle of an articulated object costs, how that grows, and how exact it is."""

from collections.abc import Callable, Iterator

import jax
import jax.numpy as jnp
import numpy as np

import scenes
from jaxpf.experiments.claims import Measured
from jaxpf.experiments.comparison_table import Cell, Table
from jaxpf.experiments.gonzales2011 import times
from jaxpf.experiments.gonzales2011.published import (
    FRAMES,
    RUNS,
    SHARPNESS,
    TABLE_1,
    TABLE_1_PARTICLES,
)
from jaxpf.experiments.gonzales2011.tracking import NOISE, SAMPLES, learn
from jaxpf.experiments.speed import Row, compared, median_interval
from jaxpf.models.likelihoods.color import hsv_bins

#: The largest object and particle set of table 1.
PARTS, PARTICLES = 11, 200
#: Asked of a particle, a part and a frame, nanoseconds; a hundredth of the published time is 410.
GOAL = 700


def rows(repeats: int, runs: int = RUNS, num_frames: int = 10) -> Iterator[Row]:
    """Table 1's largest cell with all runs of a figure batched, for ``jaxpf bench``."""
    found = times.measure_times((PARTS,), (PARTICLES,), num_frames, repeats, runs)
    seconds = found[PARTS, PARTICLES]
    for method in times.METHODS:
        goal = {"PS": f"<= {GOAL} ns", "SPS combinatorial": f"<= {times.AT_MOST}"}.get(method, "")
        yield compared(
            f"{PARTS} parts, {method}",
            seconds[method],
            PARTS * PARTICLES * FRAMES,
            seconds["PS"],
            "this / PS",
            goal,
        )


def speed_table(repeats: int, report: Callable[[str], None] = lambda line: None) -> Table:
    """``rows`` beside the published times."""
    report(f"Speed: {PARTS} parts, N = {PARTICLES}, {RUNS} runs batched")
    shown = []
    for row, method in zip(rows(repeats), times.METHODS, strict=True):
        before = TABLE_1[PARTS]["PS" if method == "PS" else "SPS"][-1]
        baseline = TABLE_1[PARTS]["PS"][-1]
        cells = [
            Cell(1e9 * before / (PARTS * PARTICLES * FRAMES), Measured(row.nanoseconds, *_NONE)),
            Cell(before / baseline, Measured(row.ratio, row.low, row.high), digits=3),
        ]
        shown.append((row.what, cells))
    return Table(
        "speed",
        f"CPU nanoseconds per particle, part and frame: N = {PARTICLES}, {RUNS} runs batched",
        ["", "ns", "this / PS"],
        shown,
        f"Median of {repeats} interleaved repeats, {SAMPLES} x {SAMPLES} samples of every part, "
        f"one device; the goal was {GOAL} ns, and at most {times.AT_MOST} for SPS combinatorial.",
    )


_NONE = (float("nan"), float("nan"))


def growth_table(found: times.Times) -> Table:
    """How table 1 grows with N and with P; one that is linear grows as they do."""
    parts, particles = (sorted({key[k] for key in found}) for k in (0, 1))
    few, many = particles[-2], particles[-1]
    steps = [
        *(((p, few), (p, many), f"{p} parts, N from {few} to {many}") for p in parts),
        *(
            ((parts[0], n), (parts[-1], n), f"{parts[0]} to {parts[-1]} parts, N = {n}")
            for n in (particles if len(parts) > 1 else ())
        ),
    ]
    rows = []
    for before, after, label in steps:
        linear = after[0] * after[1] / (before[0] * before[1])
        cells: list[Cell | str] = [f"{linear:.2f}"]
        for method in times.METHODS:
            published = [_published(method, cell) for cell in (before, after)]
            ratio = found[after][method] / found[before][method]
            known = None if None in published else published[1] / published[0]  # type: ignore[operator]
            cells.append(Cell(known, Measured(*median_interval(ratio)), digits=2))
        rows.append((label, cells))
    return Table(
        "growth",
        "How many times longer table 1 takes as N and P grow",
        ["", "linear", *times.METHODS],
        rows,
        "At most as much as linear: what a frame costs once for all parts and particles counts "
        "less and less.",
    )


def _published(method: str, cell: tuple[int, int]) -> float | None:
    if cell[0] not in TABLE_1 or cell[1] not in TABLE_1_PARTICLES:
        return None
    row = TABLE_1[cell[0]]["PS" if method == "PS" else "SPS"]
    return row[TABLE_1_PARTICLES.index(cell[1])]


def accuracy_table(num_parts: int = 7, poses_per_part: int = 40) -> Table:
    """The sampled log-likelihood against one that counts every pixel."""
    rows = []
    for samples in (8, SAMPLES, 12, 16):
        error = likelihood_errors(samples, num_parts, poses_per_part)
        # Within a part: what all its particles share changes no weight.
        spread = np.sqrt(error.var(axis=1, ddof=1).mean())
        rows.append((f"{samples} x {samples}", [f"{error.mean():.2f}", f"{spread:.2f}"]))
    return Table(
        "likelihood_error",
        "Log-likelihood from samples of a part, less that from every pixel",
        ["samples", "mean", "standard deviation"],
        rows,
        f"Sharpness {SHARPNESS:g}; {num_parts} parts, poses strewn around the truth as the "
        "absolute dynamics strew them.  The mean is nearly the same for all particles of a part "
        "and leaves their weights alone; the standard deviation is that around the part's mean.",
    )


def likelihood_errors(samples: int, num_parts: int = 7, poses_per_part: int = 40) -> np.ndarray:
    """Log-likelihood errors ``[P, M]`` of M poses of every part, on the smooth scene."""
    scene = scenes.make("articulated", 0, num_parts=num_parts, num_frames=1)
    likelihood, frame = learn(scene, samples), jnp.asarray(scene.frames[0])
    position, angle = NOISE["smooth"].absolute
    strewn = np.random.default_rng(0).normal(size=(num_parts, poses_per_part, 3))
    poses = scene.extras["poses"][0][:, None] + strewn * [position, position, angle]
    x, y, theta = poses.reshape(-1, 3).T
    partition = np.repeat(np.arange(num_parts), poses_per_part)
    substates = jnp.asarray(np.stack([x, y, np.ones_like(x), theta]), jnp.float32)
    sampled = jax.jit(likelihood.log_prob_all)(likelihood.observe(frame), partition, substates)
    bins = np.asarray(likelihood.bin_lookup)[np.asarray(hsv_bins(frame))]
    references = np.asarray(likelihood.references)[:, 0]
    exact = [
        _every_pixel(bins, references[part], pose, scene.sizes[part])
        for part, pose in zip(partition, poses.reshape(-1, 3), strict=True)
    ]
    return (np.asarray(sampled, float) - np.array(exact)).reshape(num_parts, -1)


def _every_pixel(
    bins: np.ndarray, reference: np.ndarray, pose: np.ndarray, size: np.ndarray
) -> float:
    """Log-likelihood of a pose, from all pixels whose middle lies in the rectangle."""
    rows, columns = np.indices(bins.shape) + 0.5
    across, down = columns - pose[0], rows - pose[1]
    cosine, sine = np.cos(pose[2]), np.sin(pose[2])
    inside = (np.abs(cosine * across + sine * down) < size[0] / 2) & (
        np.abs(cosine * down - sine * across) < size[1] / 2
    )
    counts = np.bincount(bins[inside], minlength=len(reference) + 1)[: len(reference)]
    similarity = np.sum(np.sqrt(counts / inside.sum()) * reference)
    return -SHARPNESS * (1 - similarity)
