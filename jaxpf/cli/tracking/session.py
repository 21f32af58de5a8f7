"""A run of ``jaxpf track``: its opened inputs, its tracker, and what is counted on the way."""

import dataclasses
from collections.abc import Generator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from jaxpf import contract, filters
from jaxpf.cli.shared.console import say
from jaxpf.cli.tracking import detector as detector_of
from jaxpf.cli.tracking.later import all_names
from jaxpf.cli.tracking.request import Request, check_together
from jaxpf.cli.tracking.track_table import Tracks
from jaxpf.cli.tracking.user_tracker import tracker_of_start
from jaxpf.cli.tracking.writers import Counts, Population
from jaxpf.contract.errors import InputError
from jaxpf.detections import open_model
from jaxpf.files import states
from jaxpf.filters import SideBySide
from jaxpf.media.frame_source import FrameSource
from jaxpf.media.video import open_frames
from jaxpf.running.memory import check_memory, needed_by
from jaxpf.sequences.layouts import read_truth
from jaxpf.sequences.tables import BoxTable
from jaxpf.targets.building import build, looks_of
from jaxpf.targets.target import Start

if TYPE_CHECKING:
    from jaxpf.contract.types import TrackerLike

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


@dataclasses.dataclass
class Session:
    """A run of ``jaxpf track``, opened and checked.

    Attributes:
        request: the request.
        source: the video.
        first: the start frame.
        frames: frames after the start frame.
        start: where objects start.
        later: frame -> objects that start, or start again, after the start frame.
        truth: boxes of --truth, or None.
        output: folder for the results.
        tracker: the tracker to run, possibly a wrapper that repeats a filter side by side.
        before: state of --resume and its number of frames; else None and 0.
        counts: numbers of frames and failures.
        population: starts and ends; None for a fixed set of objects.
        tracks: writer of tracks.csv, which keeps its table; None before the first frame.
        ess: effective sample sizes of the tracked frames.
        stopped: the exception that ended the run early, or None.
        seconds: time of the first frame, which includes compilation, and of all others.
        has_begun: whether files of an earlier run have been replaced.
    """

    request: Request
    source: FrameSource
    first: np.ndarray
    frames: Generator[np.ndarray]
    start: Start
    later: dict[int, Start]
    truth: BoxTable | None
    output: Path
    tracker: Any = None
    before: tuple[Any, int] = (None, 0)
    counts: Counts = dataclasses.field(init=False)
    population: Population | None = None
    tracks: Tracks | None = None
    ess: list[float] = dataclasses.field(default_factory=list)
    stopped: KeyboardInterrupt | InputError | None = None
    seconds: tuple[float, float] = (0.0, 0.0)
    has_begun: bool = False

    def __post_init__(self) -> None:
        is_fixed = self.request.detector is None
        self.counts = Counts(self.names if is_fixed else ())
        self.population = None if is_fixed else Population()

    @property
    def names(self) -> np.ndarray:
        """Names of all objects of a fixed set of objects, in the order of their first frames."""
        return all_names(self.start, self.later)

    @property
    def filter(self) -> Any:
        """The filter that is repeated side by side; else the tracker."""
        return self.tracker.tracker if self.request.run.runs else self.tracker

    @property
    def table(self) -> dict[str, Any]:
        """Contents of run.toml."""
        return self.request.table(self.source.path)

    @property
    def is_kept(self) -> bool:
        """Whether there are results to keep."""
        return self.stopped is None or self.counts.tracked > 0

    def build(self) -> None:
        """Build the tracker, and read the state from which it resumes."""
        run = self.request.run
        self.tracker = self.tracker_at(self.first, self.start)
        fewer = " or fewer runs (--runs)" if run.runs else ""
        check_memory(needed_by(self.tracker), f"ask for fewer particles (-n){fewer}")
        self.before = _state_before(self.request, self.tracker)

    def tracker_at(self, frame: np.ndarray, start: Start) -> "TrackerLike":
        """Build the tracker of objects that start at a frame, uint8 RGB ``[H, W, 3]``."""
        request, of_filter = self.request, self.request.filter_options
        if request.run.tracker:
            of_video = self.source.name, frame, start.shapes, self.source.fps
            return tracker_of_start(request.run.tracker, *of_video)
        if request.detector is not None:
            capacity = request.detector.rules.capacity
            size = request.detector.typical_size
            model = open_model(
                request.model, frame.shape[:2], capacity, size, of_filter["num_particles"]
            )
            return filters.build(model, **of_filter)
        looks = looks_of(frame, of_filter["num_particles"])
        tracker = build(request.target, {**request.model, **of_filter}, start, looks)
        if request.run.runs is not None:
            return SideBySide(tracker, request.run.runs)
        return tracker


def open_session(request: Request) -> Session:
    """Open the video, read where objects start, and check the request against both."""
    run_options = request.run
    source = open_frames(request.video, run_options.fps, run_options.range)
    frames = source.frames(run_options.start)
    click.get_current_context().call_on_close(frames.close)
    check_together(request, source.path, live=source.is_live)
    first = next(frames)
    start = request.target.read_start(request.starts, run_options.start, source)
    later, note = request.target.later_starts(request.starts, run_options.start, source)
    remarks = [*start.remarks, *([note] if note else [])]
    if run_options.frames is not None:
        end = run_options.start + run_options.frames
        if beyond := [at for at in later if at > end]:
            remarks.append(f"what the start file names in frame {beyond[0]} comes after --frames")
        later = {at: each for at, each in later.items() if at <= end}
    check_together(request, later=later)
    for remark in remarks:
        say(f"Note: {remark}", err=True)
    if request.detector is not None:
        detector_of.check_detector(request.detector, start, run_options.start, source)
    truth = _read_truth(request, all_names(start, later))
    output = run_options.output or Path(f"jaxpf-{source.name}")
    if isinstance(source.path, Path):
        _check_output(output, source.path)
    second = next(frames, None)  # fails before compilation
    if second is None:
        raise nothing_follows(source, run_options.start)
    frames = _after(second, frames)
    return Session(request, source, first, frames, start, later, truth, output)


def _after(frame: np.ndarray, frames: Generator[np.ndarray]) -> Generator[np.ndarray]:
    """A frame and those after it; closing the generator closes the source."""
    yield frame
    yield from frames


def _state_before(request: Request, tracker: "TrackerLike") -> tuple[Any, int]:
    """State of --resume and its number of frames; else None and 0."""
    if request.run.resume is None:
        return None, 0
    path, frames = request.run.resume, request.run.frames
    state = states.load(path, tracker)
    time = int(contract.time_of(state))
    if frames is not None and frames <= time:
        raise InputError(
            f"--resume {path} has tracked {time} frames already, and --frames {frames} includes "
            "them; give a larger number."
        )
    return state, time


def _read_truth(request: Request, names: np.ndarray) -> BoxTable | None:
    """Read the boxes of --truth, which must cover some object and frame of this run."""
    if request.run.truth is None:
        return None
    first, count = request.run.start, request.run.frames
    truth = read_truth(request.run.truth)
    ids = names if request.detector is None else np.unique(truth.id)
    shown = ", ".join(map(str, ids))
    last = np.inf if count is None else first + count
    if not (np.isin(truth.id, ids) & (truth.frame > first) & (truth.frame <= last)).any():
        until = "on" if count is None else f"to {last}"
        raise InputError(
            f"--truth {truth.source} has no box of object {shown}, which this run tracks, in the "
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


def nothing_follows(source: FrameSource, start: int) -> InputError:
    """The error for a video that ends with its start frame."""
    return InputError(
        f"no frame of '{source.path}' follows the start frame {start}, so there is nothing to "
        "track; give a longer video, or an earlier --start."
    )
