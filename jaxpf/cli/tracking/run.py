"""``jaxpf track``: open, build, follow, write, report; ``request_of`` parses and checks."""

import contextlib
import functools
import itertools
from collections.abc import Sequence
from typing import Any

import jax
import numpy as np

import scenes
from jaxpf.cli.shared.console import say
from jaxpf.cli.shared.startup import use_compile_cache
from jaxpf.cli.tracking.report import report
from jaxpf.cli.tracking.request import Request, check_together
from jaxpf.cli.tracking.results import Results, locked_folder, nothing_follows, writing_results
from jaxpf.contract.errors import InputError
from jaxpf.contract.options import applying
from jaxpf.contract.types import TrackerLike
from jaxpf.detections import follow, open_box_tracker
from jaxpf.evaluation.trackers import OwnTracker, own_tracker
from jaxpf.filters import SideBySide
from jaxpf.media.film import FrameSource
from jaxpf.media.read import open_frames
from jaxpf.targets.building import build, looks_of
from jaxpf.targets.target import Start


def track(request: Request) -> None:
    """Track, and write each frame into the output folder at once.

    After an interruption or an error the tracked frames are kept and reported; a run without any
    tracked frame leaves no files.
    """
    run, detector = request.run, request.detector
    source = open_frames(request.video, fps=run.fps, range=run.range)
    # The start frame comes before those of --frames.
    most = None if run.frames is None else run.frames + 1
    with contextlib.closing(source.frames(run.start)) as frames:
        picture = next(frames)
        start, later = read_starts(request, source)
        _check_truth(request, [start, *later.values()])
        if (second := next(frames, None)) is None:  # fails before compilation
            raise nothing_follows(source, run.start)
        use_compile_cache()
        make = functools.partial(tracker_of, request, source)
        tracker = make(picture, start)
        results = Results(request, source, {run.start: start} | later, tracker)
        state = results.resume()
        with locked_folder(results):
            with writing_results(results):
                for record in follow(
                    tracker,
                    jax.random.key(run.seed),
                    itertools.islice(itertools.chain([picture, second], frames), most),
                    start,
                    target=request.target,
                    later=later,
                    make=make,
                    detections=detector and detector.by_frame,
                    rules=detector and detector.rules,
                    state=state,
                    first=run.start,
                ):
                    results.add(record)
            report(results)


def read_starts(request: Request, source: FrameSource) -> tuple[Start, dict[int, Start]]:
    """Objects of the start frame, and frame -> those that start, or start again, later."""
    run, target, detector = request.run, request.target, request.detector
    start = target.read_start(request.starts, run.start, source)
    later, remarks = dict(start.later), [*start.remarks]
    if run.frames is not None:
        end = run.start + run.frames
        if beyond := [at for at in later if at > end]:
            remarks.append(f"what the start file names in frame {beyond[0]} comes after --frames")
        later = {at: each for at, each in later.items() if at <= end}
    check_together(request, live=source.is_live, later=later)
    for remark in remarks:
        say(f"Note: {remark}", err=True)
    if detector is None:
        return start, later
    detector.check(start, run.start, source)
    named, of_detector = detector.starts(start, run.start)
    return named, later | of_detector


def tracker_of(
    request: Request, source: FrameSource, frame: np.ndarray, start: Start
) -> TrackerLike:
    """Build the tracker of objects that start at a frame, uint8 RGB ``[H, W, 3]``."""
    run, options, detector = request.run, request.options, request.detector
    if run.tracker:
        return _own_tracker(run.tracker, source, frame, start.shapes)
    if detector is not None:
        about: dict[str, Any] = applying(options, request.target.tracker, request.filter.build)
        about |= {"capacity": detector.rules.capacity, "typical_size": detector.typical_size}
        return open_box_tracker(frame.shape, **about)
    looks = looks_of(frame, options["num_particles"])
    tracker = build(request.target, {**options}, start, looks)
    return tracker if run.runs is None else SideBySide(tracker, run.runs)


def _own_tracker(place: str, source: FrameSource, frame: np.ndarray, boxes: np.ndarray) -> Any:
    """Call the function of --tracker with a scene that consists of the start frame."""
    scene = scenes.Scene(
        name=source.name,
        frames=frame[None],
        boxes=boxes[None],
        patches=[scenes.cut_patch(frame, box) for box in boxes],
        fps=source.fps,
        parameters={},
        settings={},
    )
    tracker = own_tracker(place, OwnTracker.read(place), scene)
    if hasattr(tracker, "init"):
        return tracker
    raise InputError(f"the tracker {place!r} returned boxes; for a video return a tracker.")


def _check_truth(request: Request, starts: Sequence[Start]) -> None:
    """Refuse truth that covers no object and frame of this run."""
    truth, first, count = request.truth, request.run.start, request.run.frames
    if truth is None:
        return
    names = dict.fromkeys(name for start in starts for name in start.ids.tolist())
    ids = list(names) if request.detector is None else np.unique(truth.id)
    last = np.inf if count is None else first + count
    if not (np.isin(truth.id, ids) & (truth.frame > first) & (truth.frame <= last)).any():
        until = "on" if count is None else f"to {last}"
        raise InputError(
            f"--truth {truth.source} has no box of object {', '.join(map(str, ids))}, which this "
            f"run tracks, in the frames from {first + 1} {until} (counting from 0); give another "
            "start or the truth of these objects, or leave it out."
        )
