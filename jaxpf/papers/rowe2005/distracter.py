"""Labelled particles beside PS, DPS and SPS: smith2004's scene, the same likelihood, equal time.

Labelled particles never put objects together, so that an object cannot lose by what another's
particle is worth; they cannot use what is known of several objects either, which here is nothing:
the objects are independent.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

import jaxpf
import scenes
from jaxpf import ordering
from jaxpf.boxes.target import box_model
from jaxpf.likelihoods.histogram import histogram_from_patches
from jaxpf.measures import metrics
from jaxpf.measures.timing import seconds_of
from jaxpf.papers.judging.comparison_table import Rows, Table
from jaxpf.papers.judging.estimates import mean_cell, share_cell
from jaxpf.papers.measuring.checkpoints import part
from jaxpf.papers.measuring.comparison import SMITH2004_PARTICLES, SMITH2004_SCALE
from jaxpf.papers.measuring.grid import run_keys, with_bins
from jaxpf.papers.smith2004.scenes import NUM_OBJECTS, SCENE
from jaxpf.shapes.rectangles import boxes_from_substates

SHARPNESS, RUNS_PER_SCENE = 30.0, 4
METHODS = ("PS", "DPS", "SPS", "labelled", "labelled, feedback")


class Measured(NamedTuple):
    """What S scenes gave a method.

    Attributes:
        particles: N, of a labelled filter all targets' together.
        cost: CPU time over that of PS, in the runs themselves.
        recovered: ``[S, R]`` bool, object 1 was tracked in the last frame.
        success: ``[S, R (P - 1)]`` bool, objects 2 to P were tracked throughout.
        overlap: ``[S]``, mean intersection over union of objects 2 to P.
    """

    particles: int
    cost: float
    recovered: np.ndarray
    success: np.ndarray
    overlap: np.ndarray


def tracker(method: str, likelihood: Any, boxes: np.ndarray, num_particles: int) -> Any:
    """A tracker of boxes that resamples by the multinomial scheme, as smith2004's do."""
    model = box_model(likelihood, boxes, SMITH2004_SCALE)
    settings: dict[str, Any] = {"num_particles": num_particles, "resampling": "multinomial"}
    if method.startswith("labelled"):
        feedback = "estimate" if method.endswith("feedback") else "none"
        return jaxpf.Labelled(
            model.dynamics, model.likelihood, model.initial, feedback=feedback, **settings
        )
    makers: dict[str, Callable[[], Any]] = {
        "PS": lambda: ordering.ps(range(len(boxes))),
        "DPS": lambda: ordering.dps(len(boxes)),
        "SPS": lambda: ordering.sps(num_partitions=len(boxes)),
    }
    return jaxpf.Partitioned(**model._asdict(), ordering=makers[method](), **settings)


def measure(seeds: Sequence[int]) -> dict[str, Measured]:
    """Run every method on the scenes of the seeds; N is set so that all take PS's time."""
    found = part(f"distracter-{len(seeds)}", lambda: _all_methods(seeds))
    return {
        name: Measured(
            int(one["particles"]),
            float(one["cost"]),
            *(one[field] for field in Measured._fields[2:]),
        )
        for name, one in found.items()
    }


def _all_methods(seeds: Sequence[int]) -> dict[str, dict[str, Any]]:
    """Method -> fields of ``Measured``."""
    drawn = [scenes.make("distracter", seed=seed, **SCENE) for seed in seeds]
    learned = [
        histogram_from_patches(
            scene.patches,
            scene.sizes,
            sharpness=SHARPNESS,
            method="integral",
            frame_shape=scene.frames.shape[1:3],
        )
        for scene in drawn
    ]
    num_bins = max(one.references.shape[-1] for one in learned)
    learned = [with_bins(one, num_bins) for one in learned]
    # Frames, likelihoods and keys of one shape: one compiled kernel for each method and N.
    keys = [run_keys(seed, np.arange(RUNS_PER_SCENE)) for seed in seeds]
    works = list(zip(drawn, learned, keys, strict=True))
    first = dict.fromkeys(METHODS, SMITH2004_PARTICLES) | {
        name: SMITH2004_PARTICLES * NUM_OBJECTS for name in METHODS if name.startswith("labelled")
    }
    pilot = {name: _seconds(name, works[:3], number) for name, number in first.items()}
    found: dict[str, dict[str, Any]] = {}
    spent: dict[str, float] = {}
    for name in METHODS:
        number = round(first[name] * pilot["PS"] / pilot[name])
        _run(name, works[0], number)  # compile
        began = time.process_time()
        boxes = [_run(name, work, number) for work in works]
        spent[name] = time.process_time() - began
        rows = [_measured(b, s.boxes[1:]) for b, s in zip(boxes, drawn, strict=True)]
        columns = [np.stack(column) for column in zip(*rows, strict=True)]
        found[name] = Measured(number, spent[name] / spent["PS"], *columns)._asdict()
    return found


def _seconds(method: str, works: Sequence[Any], num_particles: int) -> float:
    _run(method, works[0], num_particles)
    return seconds_of(lambda: [_run(method, work, num_particles) for work in works])


def _run(method: str, work: Any, num_particles: int) -> np.ndarray:
    """Estimated boxes ``[R, T, P, 4]``."""
    scene, likelihood, keys = work
    estimate = jaxpf.monte_carlo(
        tracker(method, likelihood, np.asarray(scene.boxes[0]), num_particles),
        keys,
        jnp.asarray(scene.frames[1:]),
        _estimate,
        batch_size=len(keys),
        devices=jax.local_devices()[:1],
    )
    return np.asarray(boxes_from_substates(estimate, scene.sizes))


def _estimate(state: Any, summary: Any) -> Any:
    return summary.estimate


def _measured(boxes: np.ndarray, truth: np.ndarray) -> tuple[np.ndarray, ...]:
    recovered = np.asarray(metrics.recovery(boxes[..., :1, :], truth[:, :1]))[..., 0]
    success = np.asarray(metrics.success(boxes[..., 1:, :], truth[:, 1:])).reshape(-1)
    overlap = np.nanmean(np.asarray(metrics.overlap(boxes[..., 1:, :], truth[:, 1:])))
    return recovered, success, overlap


def table(found: Mapping[str, Measured]) -> Table:
    """All methods in one table."""
    rows: Rows = [
        (
            name,
            [
                str(one.particles),
                f"{one.cost:.2f}",
                share_cell(one.recovered),
                share_cell(one.success),
                mean_cell(100 * one.overlap, 1),
            ],
        )
        for name, one in found.items()
    ]
    return Table(
        "distracter",
        "Beyond the paper: smith2004's scene at equal time (%)",
        ["", "N", "time / PS", "object 1 recovered", "objects 2-7 tracked", "their overlap"],
        rows,
        f"Lambda = {SHARPNESS:g}; multinomial resampling.  N is set by a pilot so that all take "
        "about as long as PS with 300 particles; a labelled filter's N is of all seven objects "
        "together.  Feedback is by the last displacement, not regularised.",
    )
