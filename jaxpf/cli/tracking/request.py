"""The parsed and checked request of ``jaxpf track``, including everything that repeats the run."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import click

from jaxpf.cli.shared.flags import as_typed, parse
from jaxpf.cli.shared.scene_options import filter_options, refuse_others
from jaxpf.cli.tracking.detector import Detector, read_detector
from jaxpf.contract.errors import InputError
from jaxpf.contract.options import OPEN, Option, options_of
from jaxpf.detections.lifetimes import Rules
from jaxpf.files.writing import check_output_file
from jaxpf.filters.registry import Filter, all_filters
from jaxpf.targets.building import defaults_for, filter_for
from jaxpf.targets.target import Target

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
    """

    video: str | Path
    target: Target
    starts: Mapping[str, Any]
    run: Run
    filter: Filter
    options: Mapping[str, Any]
    detector: Detector | None

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
    detector = read_detector(values)
    filter_ = _filter_of(values["method"], target, detector is not None)
    own = options_of(target.tracker, filter_.build)
    chosen = {name: values[name] for name in typed if values[name] != OPEN}
    for name in written & (own.keys() | filter_options().keys()):
        if not own[name].applies(chosen) if name in own else "method" in typed:
            values[name] = None
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
    request = Request(values["video"], target, starts, run, filter_, options, detector)
    check_together(request)
    if run.save_state is not None:
        # A chain of runs goes on from one file, which the user names twice.
        goes_on = run.resume is not None and run.resume.resolve() == run.save_state.resolve()
        check_output_file(run.save_state, "--save-state", run.overwrite or goes_on)
    return request


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


_LEAVE = "leave one of them out."
_ONE_FILTER = "works only with the built-in filters; leave it"
#: Options with which no object starts, or is corrected, in a later frame.
NOT_WITH_LATER = ("runs", "save_state", "resume", "tracker")
#: (option, what it excludes): why; the other is an option, or known once the video is open.
_EXCLUSIONS = {
    ("detections", "tracker"): f"{_ONE_FILTER} or --tracker out.",
    ("runs", "detections"): (
        f"needs a fixed set of objects, and --detections changes it; {_LEAVE}"
    ),
    **dict.fromkeys(
        [("save_state", "detections"), ("resume", "detections")],
        f"keeps a filter's state, which does not hold the objects of --detections; {_LEAVE}",
    ),
    ("runs", "tracker"): (f"{_ONE_FILTER} out, or wrap your tracker in jaxpf.filters.SideBySide."),
    **dict.fromkeys(
        [(name, "later") for name in NOT_WITH_LATER],
        "works with objects that all start in the start frame, and the start file names later "
        "frames; leave it out, or their rows.",
    ),
    ("resume", "live"): (
        "goes on in a video that begins as it did, and '{video}' is live; leave it out, or record "
        "a video first."
    ),
}


def check_together(request: Request, video: object = None, **known: object) -> None:
    """Refuse options that exclude each other, or what is ``known`` of the opened ``video``."""
    values = vars(request.run) | {"detections": request.detector} | known
    for (name, other), why in _EXCLUSIONS.items():
        if all(values.get(each) not in (None, False, {}) for each in (name, other)):
            raise InputError(f"--{name.replace('_', '-')} {why.format(video=video)}")
