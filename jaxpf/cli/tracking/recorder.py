"""The run of ``jaxpf track``: passes frames through the tracker to a list of writers."""

import contextlib
import itertools
import time
from collections.abc import Iterator
from pathlib import Path

import jax

from jaxpf.cli.shared import console
from jaxpf.cli.shared.config import write_config
from jaxpf.cli.shared.stopping import announced_stop
from jaxpf.cli.tracking.later import starting_later
from jaxpf.cli.tracking.records import Record, Scene, changing_population, fixed_population
from jaxpf.cli.tracking.request import Run
from jaxpf.cli.tracking.session import OUTPUTS, Session, nothing_follows
from jaxpf.cli.tracking.track_table import Tracks
from jaxpf.cli.tracking.writers import Diagnostics, Overlay, Writer
from jaxpf.contract.errors import InputError
from jaxpf.files import states, writing
from jaxpf.files.store import locked
from jaxpf.media.frame_source import FrameSource

#: Seconds between two saves of the state, from which a killed run goes on.
_SAVE_EVERY = 60.0


def record(session: Session) -> None:
    """Track every frame and pass it to the writers."""
    with locked(session.output, "tracking", keep=False):
        try:
            saying = "Finishing: what was tracked is being written."
            with (
                announced_stop(saying),
                contextlib.ExitStack() as stack,
                contextlib.closing(session.frames),
            ):
                _record_frames(session, stack)
        except (KeyboardInterrupt, InputError) as error:
            session.stopped = error
        if session.has_begun and not session.is_kept:
            remove_outputs(session.output)


def _record_frames(session: Session, stack: contextlib.ExitStack) -> None:
    run, before = session.request.run, session.before
    key = jax.random.key(run.seed)
    total = _expected_frames(session.source, run)
    scene = _scene(session)
    records = _records(session, scene, key)
    total = None if total is None else max(total - before[1], 0)
    state, counts, saved = None, session.counts, time.monotonic()
    clock = time.perf_counter()
    with console.progress_bar("frames") as progress:
        task = progress.add_task("compiling", total=total)
        try:
            beginning = _until_tracked(records)
            overlay: list[Writer] = []
            if run.overlay:  # may fail, so old results are still there
                overlay = [Overlay(session.output, scene, session.source, stack)]
            remove_outputs(session.output)
            session.has_begun = True
            write_config(session.output / "run.toml", "track", session.table)
            writers = [*_writers(session, scene, stack), *overlay]
            for record in itertools.chain(beginning, records):
                for write in writers:
                    write(record)
                state = record.state
                if not record.filtered:
                    continue
                if run.save_state is not None and time.monotonic() - saved > _SAVE_EVERY:
                    states.save(run.save_state, state)
                    saved = time.monotonic()
                elapsed, clock = time.perf_counter() - clock, time.perf_counter()
                if counts.tracked == 1:
                    session.seconds = elapsed, 0.0
                    progress.reset(task, total=total, completed=1, description="tracking")
                else:
                    session.seconds = session.seconds[0], session.seconds[1] + elapsed
                    progress.advance(task)
        finally:
            if run.save_state is not None and counts.tracked:
                states.save(run.save_state, state)
        progress.update(task, total=counts.tracked)
    if counts.tracked == 0:
        raise nothing_follows(session.source, run.start + before[1])


def _records(session: Session, scene: Scene, key: jax.Array) -> Iterator[Record]:
    """The records of all frames, as they are tracked."""
    run, detector = session.request.run, session.request.detector
    frames = itertools.islice(session.frames, session.before[1], run.frames)
    given = scene, session.tracker, key, session.first, frames
    if session.later:
        return starting_later(*given, session.later, session.tracker_at)
    if detector is not None:
        return changing_population(*given, detector)
    return fixed_population(*given, session.before)


def _until_tracked(records: Iterator[Record]) -> list[Record]:
    """The records until the first tracked frame; old results stay until it is there."""
    beginning = []
    for record in records:
        beginning.append(record)
        if record.filtered:
            break
    return beginning


def _expected_frames(source: FrameSource, run: Run) -> int | None:
    """Number of frames after the start frame according to the video, or None."""
    expected = source.num_frames or source.frames_expected
    total = None if expected is None else max(expected - run.start - 1, 0)
    if run.frames is None:
        return total
    return run.frames if total is None else min(total, run.frames)


def _scene(session: Session) -> Scene:
    request, source = session.request, session.source
    is_own = bool(request.run.tracker)
    return Scene(
        target=request.target,
        tracker=session.filter,
        start=session.start,
        size=(source.width, source.height),
        shown_at=source.shown_at,
        first=request.run.start,
        check_first=(lambda summary, ids: None) if is_own else request.filter.check_first,
    )


def _writers(session: Session, scene: Scene, stack: contextlib.ExitStack) -> list[Writer]:
    detector, names = session.request.detector, session.names.tolist()
    if detector is not None:
        names = [f"slot_{number}" for number in range(1, detector.rules.capacity + 1)]
    session.tracks = Tracks(session.output, scene, stack)
    diagnostics = Diagnostics(session.output, names, stack)
    session.ess = diagnostics.ess
    writers: list[Writer] = [session.tracks, diagnostics, session.counts]
    if session.population is not None:
        writers.append(session.population)
    return writers


def remove_outputs(output: Path) -> None:
    """Remove the files of an earlier run and no others."""
    for path in (output / name for name in OUTPUTS):
        with writing.report_os_errors("replace", path):
            path.unlink(missing_ok=True)
