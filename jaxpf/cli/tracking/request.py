"""The request of ``jaxpf track``: its options, the files that they name, and what repeats it."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import click
import numpy as np

from jaxpf.boxes.target import BOXES
from jaxpf.boxes.tracks import check_boxes
from jaxpf.cli.shared.console import say
from jaxpf.cli.shared.flags import as_typed, parse
from jaxpf.cli.shared.scene_options import filter_options, refuse_others
from jaxpf.contract.errors import InputError
from jaxpf.contract.numbers import plain
from jaxpf.contract.options import OPEN, Option, options_of
from jaxpf.detections.files import DETECTED, Detections, read_detections
from jaxpf.detections.lifetimes import Rules
from jaxpf.files.writing import check_output_file
from jaxpf.filters.registry import Filter, all_filters
from jaxpf.measures.scores import import_trackeval
from jaxpf.media.film import FrameSource
from jaxpf.sequences.layouts import read_truth
from jaxpf.sequences.tables import BoxTable
from jaxpf.targets.building import defaults_for, filter_for
from jaxpf.targets.target import Start, Target

#: Maximum number of frames in a video.
_MOST_FRAMES = 2**31 - 1
#: Run options left out of run.toml because they do not affect results.
_NOT_REPEATED = ("output", "overwrite", "save_state")
#: Start flags that extend the start of a configuration file; other start flags replace it.
_ADDS_TO_START = ("ids", "mask_step", "learned")


@dataclasses.dataclass(frozen=True)
class Run:
    """Options of ``jaxpf track`` shared by all kinds of target."""

    start: Annotated[int, Option("Start frame, counting from 0.", least=0, most=_MOST_FRAMES)] = 0
    frames: Annotated[
        int | None,
        Option("Track at most this many frames after the start.", least=1, most=_MOST_FRAMES),
    ] = None
    fps: Annotated[
        float | None, Option("Frames per second.  [default: the video's or 25]", above=0.0)
    ] = None
    range: Annotated[
        tuple[int, ...] | None,
        Option(
            "LOW,HIGH: the values that become black and white (images of 16 bits only).  By "
            "default the full range, or that of the content if it fills less than a quarter.",
            length=2,
            least=0,
            most=2**16 - 1,
        ),
    ] = None
    seed: Annotated[
        int, Option("Random seed: same seed, same tracks.", least=0, most=2**32 - 1)
    ] = 0
    runs: Annotated[
        int | None,
        Option(
            "Number of runs; reports their mean and its standard error.  The runs share each "
            "frame's work: ten cost two to nine times as much as one.",
            least=2,
            most=10_000,
        ),
    ] = None
    save_state: Annotated[
        Path | None,
        Option(
            "Save the filter's state to this file, for --resume: every minute, so that a run that "
            "is killed can go on, and after the last frame."
        ),
    ] = None
    resume: Annotated[
        Path | None,
        Option(
            "Continue from a file of --save-state, after its frames, with the same options.  The "
            "tracks are identical to an uninterrupted run."
        ),
    ] = None
    output: Annotated[
        Path | None, Option("Folder for the results.  [default: jaxpf-NAME]", flags=("-o",))
    ] = None
    overwrite: Annotated[bool, Option("Replace files in an existing folder.")] = False
    overlay: Annotated[bool, Option("Write the overlay video.")] = True
    truth: Annotated[Path | None, Option("True boxes to compare with, CSV or folder.")] = None
    tracker: Annotated[
        str | None,
        Option(
            "FILE.py:FUNCTION, your own tracker.  The function receives a scene: the start frame "
            "and its boxes."
        ),
    ] = None


#: Options of ``Run`` that apply to boxes only.
OF_BOXES = ("truth", "tracker")


#: Default number of particles per place with a detector.
_PARTICLES_EACH = 100
#: Model options with a detector.  It finds the objects; the image only refines their positions.
_GUIDED: dict[str, Any] = {"sharpness": 1.0, "noise_pixels": (6.0, 4.0, 0.02)}


class Detector(NamedTuple):
    """Detections and rules for objects that come and go.

    Attributes:
        table: rows of the file.
        rules: rules of starts and ends.
        by_frame: the detections; None if the file has only boxes with ids.
    """

    table: BoxTable
    rules: Rules
    by_frame: Detections | None

    @property
    def defaults(self) -> dict[str, Any]:
        """Defaults of filter and target options that differ with --detections."""
        guided = self.by_frame is not None and self.rules.detection_noise > 0
        particles = {"num_particles": _PARTICLES_EACH * self.rules.capacity}
        return particles | (_GUIDED if guided else {})

    @property
    def typical_size(self) -> tuple[float, float]:
        """Width and height of a typical object, pixels."""
        width, height = np.median(self.table.box[:, 2:], axis=0)
        return float(width), float(height)

    def starts(self, start: Start, number: int) -> tuple[Start, dict[int, Start]]:
        """Start boxes and those of the file's rows with ids: in frame ``number``, and later."""
        named = self.table.id != DETECTED
        rows = {
            int(frame): named & (self.table.frame == frame) for frame in self.table.frame[named]
        }
        later = {
            at: BOXES.start(self.table.box[own], self.table.id[own]) for at, own in rows.items()
        }
        if (here := later.pop(number, None)) is not None:
            boxes = np.concatenate([start.shapes, here.shapes])
            start = BOXES.start(boxes, np.concatenate([start.ids, here.ids]))
        return start, later

    def check(self, start: Start, number: int, source: FrameSource) -> None:
        """Refuse detections and start boxes that do not fit the video."""
        table, capacity, file = self.table, self.rules.capacity, self.table.source
        is_beyond = table.frame.max() >= (source.num_frames or source.frames_expected or 0)
        if is_beyond and not source.is_live:
            # The length in the container may be wrong.
            count = source.num_frames or sum(1 for _ in source)
            if len(beyond := table.frame[table.frame >= count]):
                raise InputError(
                    f"{file} has a detection in frame {beyond[0]}, and the video ends with frame "
                    f"{count - 1} (both counting from 0); give the detections of this video"
                )
        named = table.id != DETECTED
        names = [f"the object that starts in frame {frame}" for frame in table.frame[named]]
        check_boxes(table.box[named], source.width, source.height, names)
        low, size = table.box[~named, :2], [source.width, source.height]
        outside = np.any((low >= size) | (low + table.box[~named, 2:] <= 0), axis=1)
        if outside.any():
            say(
                f"Note: {outside.sum()} of {len(outside)} detections of {file} lie outside the "
                "picture and are left out.",
                err=True,
            )
        for frame, identity in zip(table.frame, table.id, strict=True):
            if identity != DETECTED and frame < number:
                raise InputError(
                    f"{file} starts object {identity} in frame {frame}, and tracking starts with "
                    f"frame {number} (counting from 0); shift one of them."
                )
            if identity in start.ids:
                raise InputError(
                    f"{file} starts object {identity}, which has a start box already; give it "
                    "another number."
                )
        if np.any(start.ids < 0):
            raise InputError(
                f"object {start.ids.min()} has a negative id; count from 0 with --detections."
            )
        if len(start.ids) > capacity:
            raise InputError(
                f"object {start.ids[capacity]} is one more than the capacity of {capacity} objects "
                f"at once; ask for a larger --capacity, such as {2 * len(start.ids)}."
            )

    def why_none_started(self, start: int) -> str:
        """Explain from the detections why no object started."""
        (table, rules, by_frame), frames = self, np.zeros(0)
        if by_frame is not None:
            frames = np.unique(table.frame[by_frame.counted & (table.frame >= start)])
        if by_frame is None or len(frames) < rules.min_hits:
            return (
                f"no object started: it must be detected {rules.min_hits} times, and "
                f"{table.source} has detections in {len(frames)} of the frames from {start} on; "
                "lower --min-hits, or give more detections."
            )
        return (
            f"no object started: none was detected {rules.min_hits} times inside the picture with "
            f"an IoU of {rules.detection_iou:g} or more from one detection to the next (the "
            f"detector's step is {by_frame.every} frame(s)); lower --detection-iou or --min-hits, "
            "or correct --detection-interval."
        )


@dataclasses.dataclass(frozen=True)
class Request:
    """A run of ``jaxpf track``.

    Attributes:
        video: a file, a folder, or a live source.
        target: the kind of target.
        starts: values of its ``start_flags``.
        run: options shared by all kinds of target.
        filter: the filter family.
        options: values of the target's and of the filter's options.
        detector: detections and rules of --detections; None for a fixed set of objects.
        truth: true boxes of --truth; None without.
    """

    video: str | Path
    target: Target
    starts: Mapping[str, Any]
    run: Run
    filter: Filter
    options: Mapping[str, Any]
    detector: Detector | None
    truth: BoxTable | None

    def table(self, video: str | Path) -> dict[str, Any]:
        """Contents of run.toml: everything that repeats the run, in command-line notation.

        Args:
            video: video address without a password.
        """
        values = {**vars(self.run), **self.options}
        owners = [Run, self.target.tracker, self.filter.build]
        if self.detector is not None:
            values |= vars(self.detector.rules)
            owners.append(Rules)
        typed = as_typed(values, *owners)
        table = {"target": self.target.name, "video": video, **self.starts, **typed}
        return {
            name: value.resolve() if isinstance(value, Path) else value
            for name, value in table.items()
            if value not in (None, ()) and name not in _NOT_REPEATED
        }


def request_of(ctx: click.Context, target: Target) -> Request:
    """Build the request from the command line and a configuration file.

    Values of the file that do not go with what is typed are left out.
    """
    values = dict(ctx.params)
    source = {name: ctx.get_parameter_source(name) for name in values}
    typed = {n for n in values if source[n] is click.core.ParameterSource.COMMANDLINE}
    written = {n for n in values if source[n] is click.core.ParameterSource.DEFAULT_MAP}
    if typed & target.start_flags.keys() - {*_ADDS_TO_START}:
        values |= dict.fromkeys(written & target.start_flags.keys())
    run = Run(**parse(values, Run))
    detector = _read_detector(values)
    filter_ = _filter_of(values["method"], target, detector is not None)
    own = options_of(target.tracker, filter_.build)
    chosen = {name: values[name] for name in typed if values[name] != OPEN}
    for name in written & (own.keys() | filter_options().keys()):
        fits = own[name].applies(chosen) if name in own else "method" not in typed
        values[name] = values[name] if fits else None
    refuse_others(values, target, filter_)
    defaults, settings = {**defaults_for(target, filter_)}, {}
    if detector is not None:
        defaults |= detector.defaults
        # Objects that appear later are not in the start frame, so nothing can be learned from it.
        settings["appearance"] = "colour"
    options = target.settle(
        parse(values, target.tracker, filter_.build, defaults=defaults), settings
    )
    starts = {name: values[name] for name in target.start_flags}
    truth = None if run.truth is None else read_truth(run.truth)
    request = Request(values["video"], target, starts, run, filter_, options, detector, truth)
    check_together(request)
    if run.save_state is not None:
        # A chain of runs goes on from one file, which the user names twice.
        goes_on = run.resume is not None and run.resume.resolve() == run.save_state.resolve()
        check_output_file(run.save_state, "--save-state", run.overwrite or goes_on)
    return request


def _read_detector(options: Mapping[str, Any]) -> Detector | None:
    """Read the file of ``--detections`` and its rules; None without ``--detections``."""
    if options.get("detections") is None:
        for name, rule in options_of(Rules).items():
            if options.get(name) is not None:
                raise InputError(
                    f"{rule.flag} works only with --detections; add it, or leave {rule.flag} out."
                )
        return None
    table, rules = read_detections(options["detections"]), Rules(**parse(options, Rules))
    if not len(table):
        raise InputError(
            f"{table.source} holds no boxes; give a file with detections, or leave "
            "--detections out."
        )
    detected = table.id == DETECTED
    by_frame = Detections(table, rules) if detected.any() else None
    if by_frame is not None and not by_frame.counted.any():
        confidences = table.confidence[detected]
        raise InputError(
            f"--detection-confidence {plain(rules.detection_confidence)} leaves out every "
            f"detection of {table.source}, whose confidences are from {confidences.min():g} to "
            f"{confidences.max():g}; give a lower one."
        )
    if options["truth"]:
        import_trackeval()
    return Detector(table, rules, by_frame)


def _filter_of(method: str | None, target: Target, opens: bool) -> Filter:
    """The filter that --method or --detections selects."""
    able = [family for family in all_filters().values() if family.opens]
    if opens and not method:
        return able[0]
    chosen = filter_for(target, method)
    if opens and chosen not in able:
        names = [name for family in able for name in family.methods]
        raise InputError(
            f"--detections does not work with --method {method}, which tracks a fixed set of "
            f"objects; use --method {', '.join(names)}."
        )
    return chosen


#: Options with which no object starts, or is corrected, in a later frame.
NOT_WITH_LATER = ("runs", "save_state", "resume", "tracker")
#: What excludes options: another option, or what is known once the video is open, as shown.
_EXCLUDES = {
    ("detections", "--detections"): ("tracker", "runs", "save_state", "resume"),
    ("tracker", "--tracker"): ("runs",),
    ("later", "objects that start in a later frame"): NOT_WITH_LATER,
    ("live", "a live video"): ("resume",),
}


def check_together(request: Request, **known: object) -> None:
    """Refuse options that exclude each other, or what is ``known`` of the opened video."""
    values = vars(request.run) | {"detections": request.detector} | known
    for (other, shown), names in _EXCLUDES.items():
        for name in names:
            if all(values.get(each) not in (None, False, {}) for each in (name, other)):
                flag = f"--{name.replace('_', '-')}"
                raise InputError(f"{flag} does not work with {shown}; leave one of them out.")
