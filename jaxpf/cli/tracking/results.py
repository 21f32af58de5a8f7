"""The output folder of ``jaxpf track``: receives records, and keeps what was tracked."""

import contextlib
import time
import warnings
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from jaxpf.cli.shared import console
from jaxpf.cli.shared.flags import write_config
from jaxpf.cli.shared.stopping import announced_stop
from jaxpf.cli.tracking.columns import Columns, TrackTable
from jaxpf.cli.tracking.overlay import Overlay
from jaxpf.cli.tracking.request import Request
from jaxpf.contract import calls
from jaxpf.contract.errors import InputError
from jaxpf.detections.lifetimes import EMPTY, Changes
from jaxpf.detections.records import Group, Record
from jaxpf.files import states, writing
from jaxpf.files.store import locked
from jaxpf.files.writing import LineWriter
from jaxpf.media.film import FrameSource
from jaxpf.targets.target import Start

#: All files that a run may leave in its output folder.
OUTPUTS = (
    "tracks.csv",
    "outlines.csv",
    "overlay.mp4",
    "diagnostics.csv",
    "trajectories.png",
    "metrics.csv",
    "summary.json",
    "run.toml",
)
#: Seconds between two saves of the state, from which a killed run goes on.
_SAVE_EVERY = 60.0


class Results:
    """Writes the records of a run, and counts.

    Attributes:
        request, source, tracker: of the run.
        starts: frame -> objects that start, or start again, there; first those of the start frame.
        output: the folder.
        filter: the tracker itself, without the wrapper that repeats it.
        resumed: number of frames that an earlier run has tracked.
        names: names of the objects, in the order in which they start.
        tracked: number of tracked frames.
        last: number of the last frame.
        invalid: number of likelihoods that were not a number.
        outside: name -> frames in which the object was outside the picture.
        without_likelihood: name -> frames in which no particle of it had any likelihood.
        changes: detected objects that started, ended or were refused, by kind.
        seconds: time of the first frame, which includes compilation, and of all others.
        stopped: the exception that ended the run early, or None.
        has_begun: whether files of an earlier run have been replaced.
    """

    def __init__(
        self, request: Request, source: FrameSource, starts: Mapping[int, Start], tracker: Any
    ):
        self.request, self.source, self.starts, self.tracker = request, source, starts, tracker
        self.output = output_folder(request, source)
        self.filter: Any = tracker.tracker if request.run.runs else tracker
        self.names: list[Any] = []
        if request.detector is None:
            self.names += dict.fromkeys(n for each in starts.values() for n in each.ids.tolist())
        self.resumed = self.tracked = self.last = self.invalid = 0
        self.outside: dict[str, list[int]] = {str(name): [] for name in self.names}
        self.without_likelihood: dict[str, list[int]] = {str(name): [] for name in self.names}
        self.changes: dict[str, list[dict]] = {kind: [] for kind in Changes._fields}
        self.seconds = 0.0, 0.0
        self.stopped: KeyboardInterrupt | InputError | None = None
        self.has_begun = False
        self._columns = Columns(request.target, source.shown_at)
        self._waiting: list[tuple[Record, list[dict[str, np.ndarray]]]] = []
        self._state: Any = None
        self._saved, self._clock = time.monotonic(), time.perf_counter()

    def resume(self) -> Any:
        """Count on from the state of --resume, and return it; None without it."""
        run = self.request.run
        if run.resume is None:
            return None
        state = states.load(run.resume, self.tracker)
        self.resumed = int(calls.time_of(state))
        if run.frames is not None and run.frames <= self.resumed:
            raise InputError(
                f"--resume {run.resume} has tracked {self.resumed} frames already, and --frames "
                f"{run.frames} includes them; give a larger number."
            )
        self._columns.resume(run.start, self.filter, self.starts[run.start], state)
        return state

    @property
    def is_kept(self) -> bool:
        """Whether there are results to keep."""
        return self.stopped is None or self.tracked > 0

    def open(self, files: contextlib.ExitStack, progress: Any) -> None:
        """Take what closes the files, and the progress bar."""
        self._files, self._progress = files, progress
        run, known = self.request.run, self.source.num_frames or self.source.frames_expected
        counts = [] if known is None else [known - run.start - 1]
        counts += [] if run.frames is None else [run.frames]
        self._expected = max(min(counts) - self.resumed, 0) if counts else None
        self._task = progress.add_task("compiling", total=self._expected)

    def add(self, record: Record) -> None:
        """Write a record; old results are replaced when the first frame has been tracked."""
        columns = [self._columns(record.number, group) for group in record.groups]
        self._waiting.append((record, columns))
        if not self.has_begun:
            if not record.filtered:
                return
            self._begin(next(list(each) for each in columns if "speed" in each))
        for each in self._waiting:
            self._write(*each)
        self._waiting.clear()
        if not record.filtered:
            return
        if self.request.run.save_state and time.monotonic() - self._saved > _SAVE_EVERY:
            self.save_state()
        elapsed, self._clock = time.perf_counter() - self._clock, time.perf_counter()
        if self.tracked == 1:
            self.seconds = elapsed, 0.0
            self._progress.reset(
                self._task, total=self._expected, completed=1, description="tracking"
            )
        else:
            self.seconds = self.seconds[0], self.seconds[1] + elapsed
            self._progress.advance(self._task)

    def save_state(self) -> None:
        """Save the state for --resume."""
        if self.request.run.save_state is not None and self.tracked:
            states.save(self.request.run.save_state, self._state)
            self._saved = time.monotonic()

    def _begin(self, columns: list[str]) -> None:
        """Open the files; the overlay may fail, so it is opened while old results are there."""
        request, target, output = self.request, self.request.target, self.output
        self._overlay, enter = None, self._files.enter_context
        if request.run.overlay:
            self._overlay = Overlay(output / "overlay.mp4", target, self.source)
            enter(self._overlay.video)
        remove_outputs(output)
        self.has_begun = True
        write_config(output / "run.toml", "track", request.table(self.source.path))
        start, detector = self.starts[request.run.start], request.detector
        slots = detector and [f"slot_{number + 1}" for number in range(detector.rules.capacity)]
        diagnostics = Diagnostics(output / "diagnostics.csv", slots or self.names, bool(slots))
        self._diagnostics = enter(diagnostics)
        self._tracks = enter(TrackTable(output / "tracks.csv", target.columns, columns))
        self._outlines = enter(target.outline_file(output / "outlines.csv", start))

    def _write(self, record: Record, columns: list[dict[str, np.ndarray]]) -> None:
        """Write a frame, and count it."""
        number, filtered = record.number, record.filtered
        if self._outlines is not None:
            self._outlines(number, record.shapes)
        ids = [group.ids for group in record.groups]
        self._tracks.add(number, self.source.shown_at(number), *zip(ids, columns, strict=True))
        if self._overlay is not None:
            self._overlay.write(record, columns)
        # The number is the last one also where objects only start again.
        self.last, self._state = number, record.groups[0].state
        if record.changes is not None:
            self._count(number, record.changes)
        if not filtered:
            return
        self._diagnostics.write(record)
        self.tracked += 1
        self.invalid += int(sum(_reported(filtered, "num_invalid", 0)))
        for group in filtered:
            for where, frames in (
                (group.outside, self.outside),
                (group.without_likelihood, self.without_likelihood),
            ):
                for name in group.ids[where]:
                    frames.setdefault(str(name), []).append(number)

    def _count(self, number: int, changes: Changes) -> None:
        """Count detected objects that started, ended or were refused."""
        self.names += [new.id for new in changes.started]
        for kind, each in changes._asdict().items():
            for change in each:
                about = {"id": None if change.id == EMPTY else change.id, "frame": number}
                about |= {} if change.box is None else {"box": change.box.tolist()}
                about |= {"reason": change.reason} if change.reason else {}
                self.changes[kind].append(about)


@contextlib.contextmanager
def locked_folder(results: Results) -> Iterator[None]:
    """Prepare the output folder, and lock it until everything, the summary too, is written."""
    output, existed = results.output, results.output.is_dir()
    writing.prepare_output_folder(output, results.request.run.overwrite)
    try:
        with locked(output, "tracking", keep=False):
            yield
    finally:
        if not results.is_kept and not existed:
            with contextlib.suppress(OSError):
                output.rmdir()


@contextlib.contextmanager
def writing_results(results: Results) -> Iterator[None]:
    """Open the files; keep what was tracked, whatever ends the run.

    Ctrl-C and errors of input are kept as ``results.stopped`` and not raised.
    """
    try:
        with (
            announced_stop("Finishing: what was tracked is being written."),
            contextlib.ExitStack() as files,
            console.progress_bar("frames") as progress,
            warnings.catch_warnings(),
        ):
            # At the end, the report says how many there were.
            warnings.filterwarnings("ignore", "the log-likelihood of frame", UserWarning)
            results.open(files, progress)
            try:
                yield
            finally:
                results.save_state()
            if results.tracked == 0:
                start = results.request.run.start + results.resumed
                raise nothing_follows(results.source, start)
            progress.update(progress.task_ids[0], total=results.tracked)
    except (KeyboardInterrupt, InputError) as error:
        results.stopped = error
    if results.has_begun and not results.is_kept:
        remove_outputs(results.output)


class Diagnostics(LineWriter):
    """Writes diagnostics.csv: effective sample size, log evidence, share of distinct particles, and
    confidence, by object or by slot.
    """

    def __init__(self, path: Path, names: list[Any], by_slot: bool):
        super().__init__(path)
        self._names, self._by_slot, self._columns = names, by_slot, list[str]()

    def write(self, record: Record) -> None:
        """Write a row; a user-defined tracker may report less than the built-in ones."""
        groups = record.filtered
        if not self._columns:
            is_sure = any(group.confidence is not None for group in groups)
            self._columns = ["distinct_share", *["confidence"] * is_sure]
            names = [f"{column}_{name}" for column in self._columns for name in self._names]
            self.write_rows([["frame", "ess", "log_evidence", *names]])
        scalars = min(_reported(groups, "ess")), sum(_reported(groups, "log_evidence"))
        values = np.concatenate([scalars, *(self._row(groups, name) for name in self._columns)])
        self.write_rows([[record.number, *(f"{value:.6g}" for value in values)]])

    def _row(self, groups: list[Group], name: str) -> np.ndarray:
        """A column of the summaries; NaN where a group does not report it."""
        row = np.full(len(self._names), np.nan)
        for group in groups:
            if (values := getattr(group.summary, name, None)) is None:
                continue
            values = np.array(values, float)
            if name == "confidence":
                values[group.slots] = group.confidence
            if self._by_slot:
                return values
            row[[self._names.index(each) for each in group.ids.tolist()]] = values[group.slots]
        return row


def _reported(groups: list[Group], name: str, otherwise: float = np.nan) -> list[float]:
    """A number of each summary."""
    return [float(getattr(group.summary, name, otherwise)) for group in groups]


def remove_outputs(output: Path) -> None:
    """Remove the files of an earlier run and no others."""
    for path in (output / name for name in OUTPUTS):
        with writing.report_os_errors("replace", path):
            path.unlink(missing_ok=True)


def output_folder(request: Request, source: FrameSource) -> Path:
    """The folder for the results, which neither holds the frames nor is the video's own."""
    output = request.run.output or Path(f"jaxpf-{source.name}")
    if isinstance(source.path, Path):
        folder, video = output.resolve(), source.path.resolve()
        if folder == video or (folder == video.parent and video.name in OUTPUTS):
            raise InputError(
                f"output folder '{output}' would mix the results with the video '{video}' itself; "
                "choose another --output."
            )
    return output


def nothing_follows(source: FrameSource, start: int) -> InputError:
    """The error for a video that ends with its start frame."""
    return InputError(
        f"no frame of '{source.path}' follows the start frame {start}, so there is nothing to "
        "track; give a longer video, or an earlier --start."
    )
