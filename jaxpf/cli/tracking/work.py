"""What ``jaxpf track`` does: objects through a video, to tracks on disk."""

import contextlib
import dataclasses
import functools
from collections.abc import Generator, Iterator
from pathlib import Path
from typing import Any

import click
import numpy as np

from jaxpf.cli.shared.config import write_config
from jaxpf.cli.shared.startup import use_compile_cache
from jaxpf.cli.shared.stopping import announced_stop
from jaxpf.cli.tracking import births as births_of, motion, order
from jaxpf.cli.tracking.live import check_live, open_window, start_when_compiled, used_to_the_light
from jaxpf.cli.tracking.population_recorder import PopulationRecorder
from jaxpf.cli.tracking.recorder import Recorder, nothing_follows
from jaxpf.cli.tracking.request import Request, Run
from jaxpf.contract.errors import InputError
from jaxpf.files import writing
from jaxpf.files.locking import locked
from jaxpf.media.video import open_frames
from jaxpf.running.memory import check_memory, needed_by
from jaxpf.targets.building import build, looks_of_frame
from jaxpf.targets.target import Start

#: Everything that a run may leave in its output folder.
_OUTPUTS = (
    "tracks.csv",
    "overlay.mp4",
    "overlay.webm",
    "diagnostics.csv",
    "diagnostics.png",
    "metrics.csv",
    "uncertainty.csv",
    "smoothed.csv",
    "smoothed_uncertainty.csv",
    "smoothed_metrics.csv",
    "summary.json",
    "run.toml",
)


def track(request: Request) -> None:
    """Track, and leave everything in the output folder.

    Raises:
        InputError: what cannot be tracked; before anything is written, where it can be known.
    """
    ctx = click.get_current_context()
    run = request.run
    source = open_frames(request.video)
    request = dataclasses.replace(request, video=source.path)  # without a password
    frames = source.frames(run.start)
    ctx.call_on_close(frames.close)
    check_live(request, source)
    window = open_window(source) if run.preview else None
    first = used_to_the_light(frames) if source.is_camera else next(frames)
    start = request.adapter.read_start(request.starts, run.start, source)
    for remark in start.remarks:
        click.echo(f"Note: {remark}", err=True)
    if request.births is not None:
        births_of.check_births(request.births, start, run.start, source)
    truth = _read_truth(run, None if request.births is not None else start.ids)
    output = run.output or Path(f"jaxpf-{source.name}")
    if isinstance(source.path, Path):
        _check_output(output, source.path)
    if not source.is_camera:
        frames = _with_a_second(frames, source, run.start)
    use_compile_cache()
    import jax

    from jaxpf import smoothing

    chooses_order = request.chooses_order
    if chooses_order:
        request = order.with_order(request, None)
    tracker = _build_tracker(request, start, source, first)
    fewer = " or fewer runs (--runs)" if run.runs else ""
    check_memory(needed_by(tracker), f"ask for fewer particles (-n){fewer}")
    before = _state_before(run, tracker)
    if run.smooths:
        smoothing.check_smoothing(tracker.tracker if run.error_bars else tracker)
        if run.smooth_lag is None and source.is_live and run.frames is None:
            raise InputError(
                f"--smooth waits for the end of the clip, and that of '{source.path}' is not "
                "known; use --smooth-lag 50, or --frames."
            )
    if run.fit_motion is not None:
        model, told, frames = motion.fitted(
            request, start, looks_of_frame(first, request.filter_options.particles), frames
        )
        click.echo(f"Note: {told}", err=True)
        request = dataclasses.replace(request, model=model)
        start = dataclasses.replace(start, remarks=(*start.remarks, told))
        tracker = _build_tracker(request, start, source, first)
    if chooses_order:
        one = tracker.tracker if run.runs or run.error_bars else tracker
        best, told, frames = order.chosen(request, one, frames)
        click.echo(f"Note: {told}", err=True)
        request = order.with_order(request, best)
        start = dataclasses.replace(start, remarks=(*start.remarks, told))
        tracker = _build_tracker(request, start, source, first)
    existed = output.is_dir()
    writing.prepare_output_folder(output, run.overwrite)

    recorder = None
    stopped: KeyboardInterrupt | InputError | None = None
    with locked(output, "tracking", keep=False):
        try:
            _remove_outputs(output)
            write_config(output / "run.toml", "track", request.table())
            if source.is_camera:
                make = functools.partial(_build_tracker, request, start, source)
                tracker, first = start_when_compiled(make, tracker, first, frames, source)
            kind = Recorder if request.births is None else PopulationRecorder
            recorder = kind(output, source, request, start, tracker)
            recorder.window, recorder.before = window, before
            saying = "Finishing: what was tracked is being written."
            with announced_stop(saying), recorder, contextlib.closing(frames):
                recorder.start(run.start, first)
                recorder.follow(jax.random.key(run.seed), frames)
        except (KeyboardInterrupt, InputError) as error:
            stopped = error
        kept = recorder is not None and (stopped is None or recorder.num_tracked > 0)
        if recorder is not None and kept:
            # What was tracked stays; the first error matters more than another one at the end.
            with contextlib.suppress(*([] if stopped is None else [InputError])):
                recorder.finish(stopped, truth)
        else:
            _remove_outputs(output)
    if not kept and not existed:
        # Nothing was tracked: leave no half-made folder behind.
        with contextlib.suppress(OSError):
            output.rmdir()
    if stopped is not None:
        raise stopped


def _state_before(run: Run, tracker: Any) -> tuple[Any, int]:
    """The state of --resume, and how many frames it has seen; else None and 0."""
    if run.resume is None:
        return None, 0
    from jaxpf.files import states

    state, time = states.load(run.resume, tracker), states.saved_time(run.resume)
    if run.frames is not None and run.frames <= time:
        raise InputError(
            f"--resume {run.resume} has tracked {time} frames already, and --frames {run.frames} "
            "counts them; give more."
        )
    return state, time


def _with_a_second(
    frames: Iterator[np.ndarray], source: Any, start: int
) -> Generator[np.ndarray, None, None]:
    """The frames after the start frame, of which there must be one before anything is compiled."""
    second = next(frames, None)
    if second is None:
        raise nothing_follows(source, start)
    return motion.again([second], frames)


def _read_truth(run: Run, ids: np.ndarray | None) -> Any:
    """The table of --truth, which must say something about this run; of all ids where None."""
    if run.truth is None:
        return None
    from jaxpf.boxes.tracks import read_boxes

    truth = read_boxes(run.truth, empty_boxes="absent")
    ids = np.unique(truth.id) if ids is None else ids
    names = ", ".join(map(str, ids))
    ours = np.isin(truth.id, ids)
    if not ours.any():
        raise InputError(
            f"--truth {truth.source} has no box of object {names}, which this run tracks; give "
            "the truth of these objects, or leave it out."
        )
    after = truth.frame[ours] > run.start
    if run.frames is not None:
        after &= truth.frame[ours] <= run.start + run.frames
    if not after.any():
        until = "" if run.frames is None else f" to {run.start + run.frames}"
        raise InputError(
            f"--truth {truth.source} has no box of object {names} in the frames from "
            f"{run.start + 1}{until} (counting from 0); give another start, or leave it out."
        )
    return truth


def _build_tracker(request: Request, start: Start, source: Any, first: np.ndarray) -> Any:
    """The built-in method's tracker, which learns from the start frame, or the user's own."""
    if request.run.tracker:
        from jaxpf.cli.tracking.user_tracker import own_tracker_of, start_scene

        scene = start_scene(source.name, first, start.shapes, source.fps)
        return own_tracker_of(request.run.tracker, scene)
    if request.births is not None:
        return _open_tracker(request, request.births, first)
    options, run = request.filter_options, request.run
    looks = looks_of_frame(first, options.particles)
    made = build(request.target, request.model, request.filter, options, start, looks)
    if run.runs is not None:
        from jaxpf.filters import SideBySide

        return SideBySide(made, run.runs)
    if run.error_bars is not None:
        from jaxpf.filters import WithErrorBars

        return WithErrorBars(made, run.error_bars)
    return made


def _open_tracker(request: Request, births: births_of.Births, first: np.ndarray) -> Any:
    """The tracker with a place for everybody who may come."""
    from jaxpf.populations import open_model

    options, capacity = request.filter_options, births.rules.capacity
    request.filter.check(options, (-1,) * capacity)
    made = open_model(
        request.model, first.shape[:2], capacity, births.typical_size, options.particles
    )
    return request.filter.tracker(made, options)


def _check_output(output: Path, video: Path) -> None:
    """Refuse to write among the frames, or over the video, that the run reads."""
    folder, video = output.resolve(), video.resolve()
    if folder == video or (folder == video.parent and video.name in _OUTPUTS):
        raise InputError(
            f"output folder '{output}' would mix the results with the video '{video}' itself; "
            "choose another --output."
        )


def _remove_outputs(output: Path) -> None:
    """Remove the files of a run, what one that was killed left of them, and no others."""
    for name in map(Path, _OUTPUTS):
        unfinished = output.glob(f".{name.stem}.*.partial{name.suffix}")
        for path in (output / name, *unfinished):
            with writing.report_os_errors("replace", path):
                path.unlink(missing_ok=True)
