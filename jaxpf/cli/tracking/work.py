"""``jaxpf track`` in steps: open, build, run, finish; ``request_of`` parses."""

import contextlib
import dataclasses
from collections.abc import Generator
from pathlib import Path
from typing import Any

import click
import numpy as np

from jaxpf.cli.shared.console import say
from jaxpf.cli.shared.startup import use_compile_cache
from jaxpf.cli.tracking import births as births_of
from jaxpf.cli.tracking.finishing import finish
from jaxpf.cli.tracking.later import check_later
from jaxpf.cli.tracking.live import check_live, start_when_compiled, used_to_the_light
from jaxpf.cli.tracking.recorder import OUTPUTS, nothing_follows, record_run
from jaxpf.cli.tracking.request import Request
from jaxpf.contract.errors import InputError
from jaxpf.files import writing
from jaxpf.media.video import open_frames
from jaxpf.running.memory import check_memory, needed_by
from jaxpf.targets.building import build, looks_of_frame
from jaxpf.targets.target import Start

#: Advice when memory is insufficient.
_LESS_MEMORY = "ask for fewer particles (-n)"


@dataclasses.dataclass(frozen=True)
class Opened:
    """The opened and checked inputs of a request.

    Attributes:
        source: the video.
        first: the start frame.
        frames: frames after the start frame.
        start: where objects start.
        later: frame -> objects that start, or start again, after the start frame.
        truth: boxes of --truth, or None.
        output: folder for the results.
    """

    source: Any
    first: np.ndarray
    frames: Generator[np.ndarray]
    start: Start
    later: dict[int, Start]
    truth: Any
    output: Path


@dataclasses.dataclass(frozen=True)
class Built:
    """The tracker to run.

    Attributes:
        tracker: the tracker to run, possibly a wrapper that repeats a filter side by side.
        filter: the repeated filter; else the tracker.
        before: state of --resume and its number of frames; else None and 0.
    """

    tracker: Any
    filter: Any
    before: tuple[Any, int]


def track(request: Request) -> None:
    """Track, and write each frame into the output folder at once.

    After an interruption or an error the tracked frames are kept, and ``finish`` reports them; a
    run without any tracked frame leaves no files.
    """
    opened = open_input(request)
    use_compile_cache()
    built = build_tracker(request, opened)
    existed = opened.output.is_dir()
    writing.prepare_output_folder(opened.output, request.run.overwrite)

    def restart() -> tuple[Any, np.ndarray]:
        # Objects may have moved during compilation: start at a later frame.
        def make(frame: np.ndarray) -> Any:
            return tracker_at(frame, request, opened)

        source = opened.source
        started = start_when_compiled(make, built.tracker, opened.first, opened.frames, source)
        source.count_from(request.run.start)
        return started

    def make(frame: np.ndarray, start: Start) -> Any:
        return tracker_at(frame, request, dataclasses.replace(opened, start=start))

    restart_camera = restart if opened.source.is_camera else None
    recording = record_run(request, opened, built, restart_camera, make)
    if not recording.is_kept and not existed:
        with contextlib.suppress(OSError):
            opened.output.rmdir()
    finish(recording, opened.truth)


def open_input(request: Request) -> Opened:
    """Open the video, read where objects start, and check the request against both."""
    run_options = request.run
    source = open_frames(request.video, run_options.fps)
    frames = source.frames(run_options.start)
    click.get_current_context().call_on_close(frames.close)
    check_live(request, source)
    first = used_to_the_light(frames) if source.is_camera else next(frames)
    start = request.target.read_start(request.starts, run_options.start, source)
    later, note = request.target.later_starts(request.starts, run_options.start, source)
    if run_options.frames is not None:
        later = {at: s for at, s in later.items() if at <= run_options.start + run_options.frames}
    if later:
        check_later(request)
    for remark in (*start.remarks, *([note] if note else [])):
        say(f"Note: {remark}", err=True)
    if request.births is not None:
        births_of.check_births(request.births, start, run_options.start, source)
    truth = _read_truth(request, start)
    output = run_options.output or Path(f"jaxpf-{source.name}")
    if isinstance(source.path, Path):
        _check_output(output, source.path)
    if not source.is_camera:
        second = next(frames, None)  # fails before compilation
        if second is None:
            raise nothing_follows(source, run_options.start)
        frames = _after(second, frames)
    if run_options.smooth and source.is_live and run_options.frames is None:
        raise InputError(
            f"--smooth waits for the end of the clip, and the end of '{source.path}' is unknown; "
            "use --smooth-lag 50, or --frames."
        )
    return Opened(source, first, frames, start, later, truth, output)


def _after(frame: np.ndarray, frames: Generator[np.ndarray]) -> Generator[np.ndarray]:
    """A frame and those after it; closing the generator closes the source."""
    yield frame
    yield from frames


def build_tracker(request: Request, opened: Opened) -> Built:
    """Build the tracker, and read the state from which it resumes."""
    from jaxpf import smoothing

    tracker = tracker_at(opened.first, request, opened)
    fewer = " or fewer runs (--runs)" if request.run.runs else ""
    check_memory(needed_by(tracker), _LESS_MEMORY + fewer)
    repeats = request.run.runs or request.run.error_bars
    filter_ = tracker.tracker if repeats else tracker
    if request.run.smooths:
        smoothing.check_smoothing(filter_)
    return Built(tracker, filter_, _state_before(request, tracker))


def tracker_at(frame: np.ndarray, request: Request, opened: Opened) -> Any:
    """Build the tracker that starts at a frame, uint8 RGB ``[H, W, 3]``."""
    options, start = request.filter_options, opened.start
    if request.run.tracker:
        from jaxpf.cli.tracking.user_tracker import own_tracker_of, start_scene

        scene = start_scene(opened.source.name, frame, start.shapes, opened.source.fps)
        return own_tracker_of(request.run.tracker, scene)
    if request.births is not None:
        from jaxpf.populations import open_model

        capacity = request.births.rules.capacity
        request.filter.check(options, (-1,) * capacity)
        size = request.births.typical_size
        model = open_model(request.model, frame.shape[:2], capacity, size, options.particles)
        return request.filter.tracker(model, options)
    looks = looks_of_frame(frame, options.particles)
    tracker = build(request.target, request.model, request.filter, options, start, looks)
    if request.run.runs is not None:
        from jaxpf.filters import SideBySide

        return SideBySide(tracker, request.run.runs)
    if request.run.error_bars is not None:
        from jaxpf.filters import WithErrorBars

        return WithErrorBars(tracker, request.run.error_bars)
    return tracker


def _state_before(request: Request, tracker: Any) -> tuple[Any, int]:
    """State of --resume and its number of frames; else None and 0."""
    if request.run.resume is None:
        return None, 0
    from jaxpf import contract
    from jaxpf.files import states

    path, frames = request.run.resume, request.run.frames
    state = states.load(path, tracker)
    time = int(contract.time_of(state))
    if frames is not None and frames <= time:
        raise InputError(
            f"--resume {path} has tracked {time} frames already, and --frames {frames} includes "
            "them; give a larger number."
        )
    return state, time


def _read_truth(request: Request, start: Start) -> Any:
    """Read the boxes of --truth, which must cover some object and frame of this run."""
    if request.run.truth is None:
        return None
    from jaxpf.sequences.layouts import read_truth

    first, count = request.run.start, request.run.frames
    truth = read_truth(request.run.truth)
    ids = start.ids if request.births is None else np.unique(truth.id)
    names = ", ".join(map(str, ids))
    last = np.inf if count is None else first + count
    if not (np.isin(truth.id, ids) & (truth.frame > first) & (truth.frame <= last)).any():
        until = "on" if count is None else f"to {last}"
        raise InputError(
            f"--truth {truth.source} has no box of object {names}, which this run tracks, in the "
            f"frames from {first + 1} {until} (counting from 0); give another start or the truth "
            "of these objects, or leave it out."
        )
    return truth


def _check_output(output: Path, video: Path) -> None:
    """Refuse to write into the folder of frames, or over the video, that the run reads."""
    folder, video = output.resolve(), video.resolve()
    if folder == video or (folder == video.parent and video.name in OUTPUTS):
        raise InputError(
            f"output folder '{output}' would mix the results with the video '{video}' itself; "
            "choose another --output."
        )
