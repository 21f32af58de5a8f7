"""The parsed and checked request of ``jaxpf track``, including everything that repeats the run."""

import dataclasses
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any

import click

from jaxpf import filters
from jaxpf.cli.shared.flags import as_typed, picked, refuse_others
from jaxpf.cli.tracking.detector import Detector, defaults_of, read_detector
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
        model: values of the target's options.
        filter: the filter family.
        filter_options: values of the filter's options.
        detector: detections and rules of --detections; None for a fixed set of objects.
    """

    video: str | Path
    target: Target
    starts: Mapping[str, Any]
    run: Run
    model: Mapping[str, Any]
    filter: Filter
    filter_options: Mapping[str, Any]
    detector: Detector | None

    def table(self, video: str | Path) -> dict[str, Any]:
        """Contents of run.toml: everything that repeats the run, in command-line notation.

        Args:
            video: video address without a password.
        """
        values = {"target": self.target.name, "video": video, **self.starts}
        values |= {n: v for n, v in as_typed(Run, vars(self.run)).items() if n not in _NOT_REPEATED}
        values |= as_typed(self.target.tracker, self.model)
        values |= as_typed(self.filter.build, self.filter_options)
        if self.detector is not None:
            values |= as_typed(Rules, vars(self.detector.rules))
        return {
            name: value.resolve() if isinstance(value, Path) else value
            for name, value in values.items()
            if value not in (None, ())
        }


def request_of(ctx: click.Context, target: Target) -> Request:
    """Build the request from the command line and a configuration file."""
    values = _given(ctx, target)
    run = Run(**picked(Run, values))
    detector = read_detector(values)
    filter_ = _filter_of(values["method"], target, detector is not None)
    refuse_others(values, target, filter_)
    particles, of_target = defaults_of(detector)
    defaults = {**defaults_for(target, filter_), **particles}
    of_filter = picked(filter_.build, values, defaults)
    # Objects that appear later are not in the start frame, so nothing can be learned from it.
    settings = {} if detector is None else {"appearance": "colour"}
    model = target.settle(picked(target.tracker, values, of_target), settings)
    starts = {name: values[name] for name in target.start_flags}
    request = Request(values["video"], target, starts, run, model, filter_, of_filter, detector)
    check_together(request)
    if run.save_state is not None:
        # A chain of runs goes on from one file, which the user names twice.
        goes_on = run.resume is not None and run.resume.resolve() == run.save_state.resolve()
        check_output_file(run.save_state, "--save-state", run.overwrite or goes_on)
    return request


_LEAVE = "leave one of them out."
#: Options with which no object starts, or is corrected, in a later frame.
NOT_WITH_LATER = ("runs", "save_state", "resume", "tracker")
#: Options, what they exclude, and why: another option, or what is known once the video is open.
_EXCLUSIONS = (
    (
        ("detections",),
        "tracker",
        "works only with the built-in filters; leave it or --tracker out.",
    ),
    (
        ("runs",),
        "detections",
        f"needs a fixed set of objects, and --detections changes it; {_LEAVE}",
    ),
    (
        ("save_state", "resume"),
        "detections",
        f"keeps a filter's state, which does not hold the objects of --detections; {_LEAVE}",
    ),
    (
        ("runs",),
        "tracker",
        "works only with the built-in filters; leave it out, or wrap your tracker in "
        "jaxpf.filters.SideBySide.",
    ),
    (
        NOT_WITH_LATER,
        "later",
        "works with objects that all start in the start frame, and the start file names later "
        "frames; leave it out, or their rows.",
    ),
    (
        ("resume",),
        "live",
        "goes on in a video that begins as it did, and '{video}' is live; leave it out, or record "
        "a video first.",
    ),
)


def check_together(request: Request, video: object = None, **known: object) -> None:
    """Refuse options that exclude each other, or what is ``known`` of the opened ``video``."""
    values = vars(request.run) | {"detections": request.detector} | known
    for names, other, why in _EXCLUSIONS:
        for name in names:
            if all(values.get(each) not in (None, False, {}) for each in (name, other)):
                raise InputError(f"--{name.replace('_', '-')} {why.format(video=video)}")


def _given(ctx: click.Context, target: Target) -> dict[str, Any]:
    """Command-line values, and values of the configuration file that do not contradict them."""
    values = dict(ctx.params)
    source = {name: ctx.get_parameter_source(name) for name in values}
    typed = {n for n in values if source[n] is click.core.ParameterSource.COMMANDLINE}
    written = {n for n in values if source[n] is click.core.ParameterSource.DEFAULT_MAP}
    left_out: set[str] = set()
    if (typed & set(target.start_flags)) - set(_ADDS_TO_START):
        left_out |= set(target.start_flags)
    families = [family.build for family in all_filters().values()]
    if "method" in typed:
        chosen = filters.filter_of(values["method"])
        left_out |= set(options_of(*families)) - set(options_of(chosen.build))
        left_out |= set() if values["method"] == "ps" else {"order"}
    owners: list[Callable[..., Any]] = [target.tracker, *families]
    for owner in owners:
        for name, option in options_of(owner).items():
            other = option.needs[0] if option.needs else ""
            if other in typed and values[other] != OPEN and not option.applies(values):
                left_out.add(name)
    return {n: None if n in left_out & written else value for n, value in values.items()}


def _filter_of(method: str | None, target: Target, opens: bool) -> Filter:
    """The filter that --method or --detections selects."""
    able_families = [family for family in all_filters().values() if family.opens]
    if opens and not method:
        return able_families[0]
    chosen = filter_for(target, method)
    if opens and not chosen.opens:
        able = [name for family in able_families for name in family.methods]
        raise InputError(
            f"--detections does not work with --method {method}, which tracks a fixed set of "
            f"objects; use --method {', '.join(able)}."
        )
    return chosen
