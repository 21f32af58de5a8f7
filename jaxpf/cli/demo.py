"""``jaxpf demo``: four orderings on smith2004's synthetic scene."""

import dataclasses
import time
from pathlib import Path
from typing import Any

import click
import cv2
import jax
import numpy as np

import scenes
from jaxpf import filters, ordering
from jaxpf.cli.shared import flags
from jaxpf.cli.shared.console import print_table, say
from jaxpf.cli.shared.flags import Command, declared_flags, parse
from jaxpf.cli.shared.startup import start_jax
from jaxpf.contract.options import options_of
from jaxpf.contract.state import Summary
from jaxpf.contract.types import TrackerLike
from jaxpf.files.writing import prepare_output_folder
from jaxpf.measures import Interval, mean_interval, success, summarise
from jaxpf.media import overlay
from jaxpf.media.video_writer import VideoWriter
from jaxpf.papers.smith2004.scenes import scene_tracker
from jaxpf.running.blocks import monte_carlo
from jaxpf.running.runs import stream
from jaxpf.shapes.rectangles import boxes_from_substates
from scenes import Scene

#: Method shown in the video.
_SHOWN = "DPS"
_COLUMNS = ("", "recovery, object 1", "success, objects 2-7", "precision", "recall", "distinct")
_PARTICLES = {"num_particles": options_of(filters.filter_of("dps").build)["num_particles"]}


@click.command("demo", cls=Command, params=declared_flags(_PARTICLES, "Options"))
@flags.whole("--runs", default=50, least=1, most=100_000, help="Independent runs per method.")
@flags.whole("--seed", default=100, most=2**20 - 1, help="Seed of the scene and of the runs.")
@flags.output("Folder for the results.", "jaxpf-demo")
@flags.overwrite
def command(runs: int, seed: int, output: Path, overwrite: bool, num_particles: int | None) -> None:
    """Compare SIR, PS, DPS and SPS on a synthetic scene, and write a video.

    Seven objects wander over noise.  A distracter that looks like object 1 appears on top of it in
    frame 3, leads the tracker away and vanishes in frame 9 (Smith & Gatica-Perez 2004).  How often
    does each method find object 1 again?  The video shows a run of DPS, the default of `jaxpf
    track`.  All methods start from the same boxes with the same seeds; intervals are at 95%.
    """
    given = {"num_particles": num_particles}
    count = parse(given, filters.filter_of("dps").build)["num_particles"]
    start_jax()
    scene = scenes.make("distracter", seed=seed)
    methods = {
        "SIR": ordering.sir(scene.num_objects),
        "PS": ordering.ps(list(range(scene.num_objects))),
        "DPS": ordering.dps(scene.num_objects),
        "SPS": ordering.sps(num_partitions=scene.num_objects),
    }
    # The objects' colours are learned once.
    tracker = scene_tracker(scene, methods["SIR"], num_particles=count)
    prepare_output_folder(output, overwrite)
    trackers = {name: dataclasses.replace(tracker, ordering=o) for name, o in methods.items()}
    say(
        f"{runs} runs per method, {scene.num_objects} objects, {count} particles, "
        f"{scene.num_frames} frames"
    )
    rows, began, truth = [], time.perf_counter(), scene.boxes[1:]
    seeds = [1000 * (seed + 1) + run for run in range(runs)]
    keys = jax.vmap(jax.random.key)(np.array(seeds))
    for name, tracker in trackers.items():
        summary = monte_carlo(tracker, keys, scene.frames[1:])
        boxes = np.asarray(boxes_from_substates(summary.estimate, scene.sizes))
        measures = summarise(boxes, truth)
        rows.append([name, *_cells(boxes, truth, measures, summary)])
        say(
            f"{name:>4}: object 1 recovered in {rows[-1][1]} of the runs "
            f"({time.perf_counter() - began:.1f} s)"
        )
        began = time.perf_counter()
    print_table("smith2004's synthetic test", _COLUMNS, rows)
    _overlay(scene, trackers[_SHOWN], seeds, output / "overlay.mp4")
    say(
        "One drawn scene with one look-alike, made to separate the methods; results vary with "
        "--seed and from film to film.  `jaxpf evaluate` compares them on a clip of your own."
    )
    say(f"{output}/: overlay.mp4 (a run of {_SHOWN}, the default of `jaxpf track`)")


def _percent(interval: Interval, index: int | tuple[()]) -> str:
    value, low, high = (100 * np.asarray(x)[index] for x in (interval[0], *interval[2:]))
    return f"{value:.0f}% [{low:.0f}, {high:.0f}]" if low < high else f"{value:.0f}%"


def _cells(
    boxes: np.ndarray, truth: np.ndarray, measures: dict[str, Any], summary: Summary
) -> list[str]:
    others_tracked = np.asarray(success(boxes, truth))[:, 1:].mean(axis=1)
    return [
        _percent(measures["recovery_rate"], 0),
        _percent(mean_interval(others_tracked, bounds=(0.0, 1.0)), ()),
        *(f"{100 * np.mean(measures[name].value[1:]):.0f}%" for name in ("precision", "recall")),
        f"{100 * np.mean(summary.distinct_share):.0f}%",
    ]


def _overlay(scene: Scene, tracker: TrackerLike, seeds: list[int], path: Path) -> None:
    """Repeat the first run and draw its particles, enlarged, with the method's name in a corner."""
    ids = list(range(1, scene.num_objects + 1))
    colours = overlay.object_colours(len(ids))
    zoom, (height, width) = 2, scene.frames.shape[1:3]
    with VideoWriter(path, zoom * width, zoom * height, 8) as video:
        for tracked in stream(tracker, jax.random.key(seeds[0]), scene.frames[1:]):
            frame = cv2.resize(
                tracked.frame, None, fx=zoom, fy=zoom, interpolation=cv2.INTER_NEAREST
            )
            cloud = np.swapaxes(np.asarray(tracked.state.substates)[..., :2], 0, 1)
            frame = overlay.draw_particles(frame, zoom * cloud, colours)
            boxes = np.asarray(boxes_from_substates(tracked.summary.estimate, scene.sizes))
            picture = overlay.draw_boxes(frame, zoom * boxes, ids, colours)
            corner = 0, zoom * height, zoom * width, zoom * height
            overlay.draw_labels(picture, [overlay.Label(_SHOWN, *corner, (255, 255, 255))])
            video.write(picture)
