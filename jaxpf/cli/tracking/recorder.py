"""The run of ``jaxpf track``: passes frames through the tracker to a list of writers."""

import contextlib
import dataclasses
import itertools
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from jaxpf.cli.shared import console
from jaxpf.cli.shared.config import write_config
from jaxpf.cli.shared.stopping import announced_stop
from jaxpf.cli.tracking.later import all_names, starting_later
from jaxpf.cli.tracking.records import Record, Scene, changing_population, fixed_population
from jaxpf.cli.tracking.request import Request
from jaxpf.cli.tracking.writers import (
    Counts,
    Diagnostics,
    Overlay,
    Population,
    Smoothed,
    Tracks,
    Writer,
)
from jaxpf.contract.errors import InputError
from jaxpf.files import writing
from jaxpf.files.locking import locked

#: Seconds between two saves of the state, from which a killed run goes on.
_SAVE_EVERY = 60.0
#: All files that a run may leave in its output folder.
OUTPUTS = (
    "tracks.csv",
    "outlines.csv",
    "overlay.mp4",
    "diagnostics.csv",
    "trajectories.png",
    "metrics.csv",
    "smoothed.csv",
    "smoothed_outlines.csv",
    "smoothed_metrics.csv",
    "summary.json",
    "run.toml",
)


@dataclasses.dataclass
class Recording:
    """State of a run while it is recorded, which ``finish`` reads.

    Attributes:
        request: the request.
        opened, built: results of the previous steps.
        tracker: the tracker that ran.
        counts: numbers of frames and failures.
        population: births and deaths; None for a fixed population.
        stopped: the exception that ended the run early, or None.
        seconds: time of the first frame, which includes compilation, and of all others.
        has_begun: whether files of an earlier run have been replaced.
    """

    request: Request
    opened: Any
    built: Any
    tracker: Any
    counts: Counts
    population: Population | None
    stopped: KeyboardInterrupt | InputError | None = None
    seconds: tuple[float, float] = (0.0, 0.0)
    has_begun: bool = False

    @property
    def output(self) -> Path:
        """The output folder."""
        return self.opened.output

    @property
    def table(self) -> dict[str, Any]:
        """Contents of run.toml."""
        return self.request.table(self.opened.source.path)

    @property
    def is_kept(self) -> bool:
        """Whether there are results to keep."""
        return self.stopped is None or self.counts.tracked > 0


def record_run(
    request: Request,
    opened: Any,
    built: Any,
    restart: Callable[[], tuple[Any, np.ndarray]] | None,
    make: Callable[[np.ndarray, Any], Any],
) -> Recording:
    """Track every frame and pass it to the writers.

    Args:
        request, opened, built: results of the previous steps.
        restart: for a camera, returns the tracker and the start frame after compilation.
        make: function from a frame and a start to a tracker, for objects that start later.
    """
    births = request.births
    recording = Recording(
        request=request,
        opened=opened,
        built=built,
        tracker=built.tracker,
        counts=Counts(all_names(opened.start, opened.later) if births is None else ()),
        population=None if births is None else Population(),
    )
    with locked(opened.output, "tracking", keep=False):
        try:
            first = opened.first
            if restart is not None:
                recording.tracker, first = restart()
            saying = "Finishing: what was tracked is being written."
            with (
                announced_stop(saying),
                contextlib.ExitStack() as stack,
                contextlib.closing(opened.frames),
            ):
                _record_frames(recording, first, stack, make)
        except (KeyboardInterrupt, InputError) as error:
            recording.stopped = error
        if recording.has_begun and not recording.is_kept:
            remove_outputs(opened.output)
    return recording


def _record_frames(
    recording: Recording, first: np.ndarray, stack: contextlib.ExitStack, make: Callable
) -> None:
    import jax

    from jaxpf.files import states

    request, opened = recording.request, recording.opened
    run, source, births = request.run, opened.source, request.births
    key, before = jax.random.key(run.seed), recording.built.before
    frames = itertools.islice(recording.opened.frames, before[1], run.frames)
    total = _expected_frames(source, run)
    scene, smoothed, look_back = _scene(recording), None, None
    if run.smooths:
        from jaxpf.smoothing import LookBack

        look_back = LookBack(scene.tracker, key, run.smooth_lag, total, first=before[1])
    if opened.later:
        records = starting_later(scene, recording.tracker, key, first, frames, opened.later, make)
    elif births is None:
        records = fixed_population(scene, recording.tracker, key, first, frames, before)
    else:
        records = changing_population(scene, recording.tracker, key, first, frames, births)
    total = None if total is None else max(total - before[1], 0)
    state, counts, saved = None, recording.counts, time.monotonic()
    clock = time.perf_counter()
    with console.progress_bar("frames") as progress:
        task = progress.add_task("compiling", total=total)
        try:
            beginning = _until_tracked(records)
            overlay = _overlay(recording, scene, stack)  # may fail, so old results are still there
            remove_outputs(opened.output)
            recording.has_begun = True
            write_config(opened.output / "run.toml", "track", recording.table)
            if look_back is not None:
                smoothed = Smoothed(opened.output, scene, look_back, stack)
            writers = [*_writers(recording, scene, smoothed, stack), *overlay]
            for record in itertools.chain(beginning, records):
                for writer in writers:
                    writer.write(record)
                state = record.state
                if record.summary is None:
                    continue
                if run.save_state is not None and time.monotonic() - saved > _SAVE_EVERY:
                    states.save(run.save_state, state)
                    saved = time.monotonic()
                elapsed, clock = time.perf_counter() - clock, time.perf_counter()
                if counts.tracked == 1:
                    recording.seconds = elapsed, 0.0
                    progress.reset(task, total=total, completed=1, description="tracking")
                else:
                    recording.seconds = recording.seconds[0], recording.seconds[1] + elapsed
                    progress.advance(task)
        finally:
            # Also after Ctrl-C: smooth the frames tracked so far and keep their state.
            if smoothed is not None and counts.tracked:
                progress.update(task, description="smoothing")
                smoothed.finish()
            if run.save_state is not None and counts.tracked:
                states.save(run.save_state, state)
        progress.update(task, total=counts.tracked)
    if counts.tracked == 0:
        raise nothing_follows(source, run.start + before[1])


def _until_tracked(records: Iterator[Record]) -> list[Record]:
    """The records until the first tracked frame; old results stay until it is there."""
    beginning = []
    for record in records:
        beginning.append(record)
        if record.summary is not None:
            break
    return beginning


def _expected_frames(source: Any, run: Any) -> int | None:
    """Number of frames after the start frame according to the video, or None."""
    expected = source.num_frames or source.frames_expected
    total = None if expected is None else max(expected - run.start - 1, 0)
    if run.frames is None:
        return total
    return run.frames if total is None else min(total, run.frames)


def _scene(recording: Recording) -> Scene:
    request, source = recording.request, recording.opened.source
    is_own, has_errors = bool(request.run.tracker), bool(request.run.error_bars)
    repeats = request.run.runs or request.run.error_bars
    return Scene(
        target=request.target,
        tracker=recording.tracker.tracker if repeats else recording.tracker,
        start=recording.opened.start,
        size=(source.width, source.height),
        shown_at=source.shown_at,
        first=request.run.start,
        cloud=lambda state: state.state if has_errors else state,
        check_first=(lambda summary, ids: None) if is_own else request.filter.check_first,
    )


def _writers(
    recording: Recording, scene: Scene, smoothed: Smoothed | None, stack: contextlib.ExitStack
) -> list[Writer]:
    request, opened = recording.request, recording.opened
    names: Any = all_names(opened.start, opened.later)
    if request.births is not None:
        names = [f"slot_{number}" for number in range(1, request.births.rules.capacity + 1)]
    writers: list[Writer] = [
        Tracks(opened.output, scene, stack),
        Diagnostics(opened.output, names, stack),
    ]
    if smoothed is not None:
        writers.append(smoothed)
    writers.append(recording.counts)
    if recording.population is not None:
        writers.append(recording.population)
    return writers


def _overlay(recording: Recording, scene: Scene, stack: contextlib.ExitStack) -> list[Writer]:
    """The writer of the overlay, if one is wanted; its file gets its name with the first frame."""
    source, output = recording.opened.source, recording.opened.output
    if not recording.request.run.overlay:
        return []
    return [Overlay(output, scene, source.fps, source.pixel_aspect, stack)]


def remove_outputs(output: Path) -> None:
    """Remove the files of an earlier run and no others."""
    for path in (output / name for name in OUTPUTS):
        with writing.report_os_errors("replace", path):
            path.unlink(missing_ok=True)


def nothing_follows(source: Any, start: int) -> InputError:
    """The error for a video that ends with its start frame."""
    return InputError(
        f"no frame of '{source.path}' follows the start frame {start}, so there is nothing to "
        "track; give a longer video, or an earlier --start."
    )
