"""The last two steps of ``jaxpf track``: run the tracker into writers, then finish the results."""

import contextlib
import dataclasses
import itertools
import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click
import numpy as np

from jaxpf.boxes.tracks import read_tracks
from jaxpf.cli.shared import console
from jaxpf.cli.shared.config import write_config
from jaxpf.cli.shared.stopping import announced_stop
from jaxpf.cli.tracking.records import Scene, changing_population, fixed_population
from jaxpf.cli.tracking.request import Request
from jaxpf.cli.tracking.verdict import object_verdicts, sentences
from jaxpf.cli.tracking.writers import (
    Counts,
    Diagnostics,
    Overlay,
    Population,
    Smoothed,
    Tracks,
    Writer,
    overlay_video,
)
from jaxpf.contract.errors import InputError
from jaxpf.files import writing
from jaxpf.files.locking import locked
from jaxpf.files.versions import versions

#: Everything that a run may leave in its output folder.
OUTPUTS = (
    "tracks.csv",
    "outlines.csv",
    "overlay.mp4",
    "overlay.webm",
    "diagnostics.csv",
    "diagnostics.png",
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
    """A run while it is recorded, and what ``finish`` needs of it.

    Attributes:
        request: the request.
        opened, settled, built: the steps before.
        table: what run.toml holds.
        tracker: that ran.
        counts: of frames and failures.
        population: births and deaths; None for a fixed population.
        stopped: what ended the run early, or None.
        seconds: of the first frame, which compiles, and of all others.
    """

    request: Request
    opened: Any
    settled: Any
    built: Any
    table: dict[str, Any]
    tracker: Any
    counts: Counts
    population: Population | None
    stopped: KeyboardInterrupt | InputError | None = None
    seconds: tuple[float, float] = (0.0, 0.0)

    @property
    def output(self) -> Path:
        """The output folder."""
        return self.opened.output

    @property
    def is_kept(self) -> bool:
        """Whether there is something to keep."""
        return self.stopped is None or self.counts.tracked > 0


def record_run(
    request: Request,
    opened: Any,
    settled: Any,
    built: Any,
    table: dict[str, Any],
    restart: Callable[[], tuple[Any, np.ndarray]] | None,
) -> Recording:
    """Track every frame into the writers.

    Args:
        request, opened, settled, built: the steps before.
        table: what run.toml holds.
        restart: for a camera, gives the tracker and the start frame once everything is compiled.
    """
    births = request.births
    recording = Recording(
        request=request,
        opened=opened,
        settled=settled,
        built=built,
        table=table,
        tracker=built.tracker,
        counts=Counts(opened.start.ids if births is None else ()),
        population=None if births is None else Population(),
    )
    with locked(opened.output, "tracking", keep=False):
        try:
            remove_outputs(opened.output)
            write_config(opened.output / "run.toml", "track", table)
            first = opened.first
            if restart is not None:
                recording.tracker, first = restart()
            saying = "Finishing: what was tracked is being written."
            with (
                announced_stop(saying),
                contextlib.ExitStack() as stack,
                contextlib.closing(settled.frames),
            ):
                _record_frames(recording, first, stack)
        except (KeyboardInterrupt, InputError) as error:
            recording.stopped = error
        if not recording.is_kept:
            remove_outputs(opened.output)
    return recording


def _record_frames(recording: Recording, first: np.ndarray, stack: contextlib.ExitStack) -> None:
    import jax

    from jaxpf.files import states

    request, opened = recording.request, recording.opened
    run, source, births = request.run, opened.source, request.births
    key, before = jax.random.key(run.seed), recording.built.before
    frames = itertools.islice(recording.settled.frames, before[1], run.frames)
    total = _expected_frames(source, run)
    scene = _scene(recording)
    smoothed = None
    if run.smooths:
        from jaxpf.smoothing import LookBack

        look_back = LookBack(scene.tracker, key, run.smooth_lag, total, first=before[1])
        smoothed = Smoothed(opened.output, scene, look_back, stack)
    writers = _writers(recording, scene, smoothed, stack)
    if births is None:
        records = fixed_population(scene, recording.tracker, key, first, frames, before)
    else:
        records = changing_population(scene, recording.tracker, key, first, frames, births)
    total = None if total is None else max(total - before[1], 0)
    state, clock, counts = None, time.perf_counter(), recording.counts
    with console.progress_bar("frames") as progress:
        task = progress.add_task("compiling", total=total)
        try:
            for record in records:
                for writer in writers:
                    writer.write(record)
                state = record.state
                if record.summary is None:
                    continue
                elapsed, clock = time.perf_counter() - clock, time.perf_counter()
                if counts.tracked == 1:
                    recording.seconds = elapsed, 0.0
                    progress.reset(task, total=total, completed=1, description="tracking")
                else:
                    recording.seconds = recording.seconds[0], recording.seconds[1] + elapsed
                    progress.advance(task)
        finally:
            # Also after Ctrl-C: the frames so far are smoothed and their state is kept.
            if smoothed is not None and counts.tracked:
                progress.update(task, description="smoothing")
                smoothed.finish()
            if run.save_state is not None and counts.tracked:
                states.save(run.save_state, state, before[1] + counts.tracked)
        progress.update(task, total=counts.tracked)
    if counts.tracked == 0:
        raise nothing_follows(source, run.start + before[1])


def _expected_frames(source: Any, run: Any) -> int | None:
    """Frames after the start frame, as far as the video says."""
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
        adapter=request.adapter,
        tracker=recording.tracker.tracker if repeats else recording.tracker,
        start=recording.opened.start,
        size=(source.width, source.height),
        fps=source.fps,
        first=request.run.start,
        cloud=lambda state: state.state if has_errors else state,
        check_first=(lambda summary, ids: None) if is_own else request.filter.check_first,
    )


def _writers(
    recording: Recording, scene: Scene, smoothed: Smoothed | None, stack: contextlib.ExitStack
) -> list[Writer]:
    request, opened = recording.request, recording.opened
    names: Any = opened.start.ids
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
    if request.run.overlay or opened.window is not None:
        video = None
        if request.run.overlay:
            video = overlay_video(opened.output, request.run.codec, opened.source)
            video = stack.enter_context(video)
        writers.append(Overlay(scene, video, opened.window))
    return writers


def finish(recording: Recording, truth: Any) -> None:
    """Write the summary and the plots, print the verdicts, and raise what ended the run early."""
    if recording.is_kept:
        # What was tracked stays; the first error matters more than one at the end.
        with contextlib.suppress(*([] if recording.stopped is None else [InputError])):
            _finish(recording, truth)
    if recording.stopped is not None:
        raise recording.stopped


def _finish(recording: Recording, truth: Any) -> None:
    from jaxpf.media import plotting

    output, start = recording.output, recording.opened.start
    table = read_tracks(output / "tracks.csv")
    diagnostics = np.loadtxt(output / "diagnostics.csv", delimiter=",", skiprows=1, ndmin=2)
    names = list(start.ids.tolist())
    slots = names
    if recording.population is not None:
        names = [birth["id"] for birth in recording.population.births]
        capacity = recording.request.births.rules.capacity  # type: ignore[union-attr]
        slots = [f"slot {number}" for number in range(1, capacity + 1)]
    verdicts = object_verdicts(table, names)
    ess = float(np.median(diagnostics[:, 1]))
    content = _summary(recording, names, verdicts, table, None if np.isnan(ess) else ess)
    writing.write_text(output / "summary.json", json.dumps(content, indent=2) + "\n")
    last = 3 + len(slots)
    num_particles = _num_particles(recording, diagnostics)
    figure = plotting.diagnostics(
        diagnostics[:, 0],
        diagnostics[:, 1],
        diagnostics[:, 3:last],
        diagnostics[:, 2],
        slots,
        num_particles,
        diagnostics[:, last:] if diagnostics.shape[1] > last else None,
    )
    plotting.save_figure(figure, output / "diagnostics.png")
    lost = {name: about["probably_lost"] for name, about in verdicts.items()}
    adapter = recording.request.adapter
    columns = [name for name in adapter.columns if name not in adapter.fixed_columns]
    figure = plotting.trajectories(table, columns, lost)
    plotting.save_figure(figure, output / "trajectories.png")
    _tell(recording, verdicts, content, None if np.isnan(ess) else ess, num_particles)
    if truth is not None:
        _report_truth(recording, truth, names)


def _num_particles(recording: Recording, diagnostics: np.ndarray) -> int:
    known = getattr(recording.tracker, "num_particles", 0)
    return int(known or np.nanmax(diagnostics[:, 1], initial=1))


def _summary(
    recording: Recording,
    names: list[Any],
    verdicts: dict[str, dict[str, Any]],
    table: Any,
    ess: float | None,
) -> dict[str, Any]:
    counts, source = recording.counts, recording.opened.source
    population, stopped = recording.population, recording.stopped
    first, rest = recording.seconds
    kept: dict[str, Any] = {}
    if population is not None:
        kept = {
            "births": population.births,
            "deaths": population.deaths,
            "refused": population.refused,
        }
    return {
        "parameters": {
            name: str(value) if isinstance(value, Path) else value
            for name, value in recording.table.items()
        },
        "likelihood_method": _likelihood_method(recording),
        "ids": names,
        **kept,
        "objects": verdicts,
        "effective_sample_size": None if ess is None else round(ess, 3),
        "frames_tracked": counts.tracked,
        "fps": source.fps,
        "interrupted": isinstance(stopped, KeyboardInterrupt),
        "error": str(stopped) if isinstance(stopped, InputError) else None,
        "video_truncated": source.truncated,
        "video_note": source.note,
        "remarks": [*recording.opened.start.remarks, *recording.settled.remarks],
        "frames_outside": counts.outside,
        "frames_without_likelihood": counts.without_likelihood,
        "mean_error": _mean_errors(table, names),
        "impossible_frames": counts.impossible,
        "invalid_likelihoods": counts.invalid,
        "seconds_first_frame": round(first, 3),
        "seconds_other_frames": round(rest, 3),
        "frames_per_second": round((counts.tracked - 1) / rest, 2) if rest > 0 else None,
        "versions": versions(),
    }


def _mean_errors(table: Any, names: list[Any]) -> dict[str, float | None] | None:
    """Mean Monte-Carlo error of x and y in pixels, by object; None unless requested."""
    if "x_error" not in table:
        return None
    ids = np.array([str(name) for name in table["id"].tolist()])
    errors = np.stack([table["x_error"], table["y_error"]])
    means = {}
    for name in map(str, names):
        values = errors[:, ids == name]
        known = np.isfinite(values)
        means[name] = round(float(values[known].mean()), 4) if known.any() else None
    return means


def _likelihood_method(recording: Recording) -> Any:
    """How the likelihood is computed, if it says so; else what was asked for."""
    if recording.request.run.tracker:
        return None
    likelihood = recording.built.filter.likelihood
    likelihood = getattr(likelihood, "likelihood", likelihood)
    return getattr(likelihood, "method", getattr(recording.settled.model, "likelihood", None))


def _tell(
    recording: Recording,
    verdicts: dict[str, dict[str, Any]],
    content: dict[str, Any],
    ess: float | None,
    num_particles: int,
) -> None:
    counts, rate = recording.counts, content["frames_per_second"]
    speed = "" if rate is None else f", {rate:.1f} frames/s"
    click.echo(f"{recording.output}: {counted(counts.tracked)} tracked{speed}")
    for line in sentences(verdicts, ess, num_particles):
        click.echo(line)
    if (errors := content["mean_error"]) is not None:
        known = [f"{name} {error:.2g}" for name, error in errors.items() if error is not None]
        if known:
            click.echo(f"Monte-Carlo error of places in pixels: {', '.join(known)}")
        else:
            _warn(
                "Note: too few ancestors were left to estimate the Monte-Carlo error; ask for "
                "fewer frames (--error-bars), more particles (-n) or --runs."
            )
    if recording.opened.source.note:
        _warn(f"Note: {recording.opened.source.note}")
    for where, frames_of in (
        ("was outside the picture", counts.outside),
        ("had no likelihood for any particle", counts.without_likelihood),
    ):
        for name, frames in frames_of.items():
            if frames:
                _warn(
                    f"Lost: object {name} {where} in {counted(len(frames))}, first in frame "
                    f"{frames[0]}."
                )
    if counts.impossible:
        _warn(
            f"Warning: {counted(counts.impossible)} had no likelihood for any particle and counted "
            "as missing."
        )
    if counts.invalid:
        _warn(f"Warning: {counts.invalid} likelihood(s) were not a number and counted as zero.")
    if recording.population is not None:
        population = recording.population
        came = counted(len(population.births), "object")
        click.echo(f"{came} came, {len(population.deaths)} went")
        if population.refused:
            refusal = population.refused[0]
            _warn(
                f"Refused: {len(population.refused)} that could not start, first in frame "
                f"{refusal['frame']}: {refusal['reason']}"
            )


def _warn(text: str) -> None:
    click.echo(text, err=True)


def _report_truth(recording: Recording, truth: Any, names: list[Any]) -> None:
    from jaxpf.cli.tracking import against_truth

    run, output = recording.request.run, recording.output
    if recording.population is not None:
        against_truth.report_identities(output, run.start, recording.counts.tracked, truth)
        return
    first = run.start + recording.built.before[1]
    against_truth.report_truth(output, names, first, truth)
    if run.smooths:
        against_truth.report_truth(output, names, first, truth, "smoothed")


def remove_outputs(output: Path) -> None:
    """Remove the files of an earlier run, also unfinished ones, and no others."""
    for name in map(Path, OUTPUTS):
        unfinished = output.glob(f".{name.stem}.*.partial{name.suffix}")
        for path in (output / name, *unfinished):
            with writing.report_os_errors("replace", path):
                path.unlink(missing_ok=True)


def nothing_follows(source: Any, start: int) -> InputError:
    """The refusal of a video that ends with its start frame."""
    return InputError(
        f"no frame of '{source.path}' follows the start frame {start}, so there is nothing to "
        "track; give a longer video, or an earlier --start."
    )


def counted(count: int, noun: str = "frame") -> str:
    """``1 frame``, ``2 frames``."""
    return f"{count} {noun}{'' if count == 1 else 's'}"
