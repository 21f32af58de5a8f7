"""The parsed and checked request of ``jaxpf track``, including everything that repeats the run."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from jaxpf import filters
from jaxpf.cli.shared.flags import as_typed, picked, refuse_others, report_implied
from jaxpf.cli.tracking.detector import Detector, defaults_of, read_detector
from jaxpf.contract.errors import InputError
from jaxpf.contract.options import OPEN, check_options, option, options_of
from jaxpf.files.writing import check_output_file
from jaxpf.filters.filter import Filter
from jaxpf.targets.appearance import COLOUR
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

    start: int = option(0, "Start frame, counting from 0.", least=0, most=_MOST_FRAMES)
    frames: int | None = option(
        None, "Track at most this many frames after the start.", least=1, most=_MOST_FRAMES
    )
    fps: float | None = option(
        None,
        "Frames per second.  [default: the video's or 25]",
        above=0.0,
    )
    range: tuple[int, ...] | None = option(
        None,
        "LOW,HIGH: the values that become black and white (images of 16 bits only).  By default "
        "the full range, or that of the content if it fills less than a quarter.",
        kind=int,
        length=2,
        least=0,
        most=2**16 - 1,
    )
    seed: int = option(0, "Random seed: same seed, same tracks.", least=0, most=2**32 - 1)
    runs: int | None = option(
        None,
        "Number of runs; reports their mean and its standard error.  The runs share each frame's "
        "work: ten cost two to nine times as much as one.",
        least=2,
        most=10_000,
    )
    save_state: Path | None = option(  # noqa: RUF009
        None,
        "Save the filter's state to this file, for --resume: every minute, so that a run that is "
        "killed can go on, and after the last frame.",
    )
    resume: Path | None = option(  # noqa: RUF009
        None,
        "Continue from a file of --save-state, after its frames, with the same options.  The "
        "tracks are identical to an uninterrupted run.",
    )
    output: Path | None = option(  # noqa: RUF009
        None,
        "Folder for the results.  [default: jaxpf-NAME]",
        flags=("-o",),
    )
    overwrite: bool = option(False, "Replace files in an existing folder.")
    overlay: bool = option(True, "Write the overlay video.")
    truth: Path | None = option(  # noqa: RUF009
        None, "True boxes to compare with, CSV or folder."
    )
    tracker: str | None = option(
        None,
        "FILE.py:FUNCTION, your own tracker.  The function receives a scene: the start frame and "
        "its boxes.",
    )

    def __post_init__(self) -> None:
        check_options(self)


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
        model: options of the target.
        filter: the filter family.
        filter_options: options of the filter.
        detector: detections and rules of --detections; None for a fixed set of objects.
    """

    video: str | Path
    target: Target
    starts: Mapping[str, Any]
    run: Run
    model: Any
    filter: Filter
    filter_options: Any
    detector: Detector | None

    def table(self, video: str | Path) -> dict[str, Any]:
        """Contents of run.toml: everything that repeats the run, in command-line notation.

        Args:
            video: video address without a password.
        """
        values = {"target": self.target.name, "video": video, **self.starts}
        values |= {n: v for n, v in as_typed(self.run).items() if n not in _NOT_REPEATED}
        values |= as_typed(self.model) | as_typed(self.filter_options)
        if self.detector is not None:
            values |= as_typed(self.detector.rules)
        return {
            name: value.resolve() if isinstance(value, Path) else value
            for name, value in values.items()
            if value not in (None, ())
        }


def request_of(ctx: click.Context, target: Target) -> Request:
    """Build the request from the command line and a configuration file."""
    values = _given(ctx, target)
    run = picked(values, Run)
    detector = read_detector(values)
    filter_ = _filter_of(values["method"], target, detector is not None)
    refuse_others(values, target, filter_)
    particles, of_target = defaults_of(detector)
    defaults = {**defaults_for(target, filter_), **particles}
    filter_options = picked(values, filter_.options, defaults)
    # Objects that appear later are not in the start frame, so nothing can be learned from it.
    settings = {} if detector is None else {"appearance": COLOUR}
    model = target.resolved(picked(values, target.options, of_target), settings)
    report_implied(values, target.resolved(target.options(), settings))
    starts = {name: values[name] for name in target.start_flags}
    request = Request(
        values["video"], target, starts, run, model, filter_, filter_options, detector
    )
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
    families = [family.options for family in filters.all_filters().values()]
    if "method" in typed:
        chosen = filters.filter_of(values["method"])
        left_out |= set(options_of(*families)) - set(options_of(chosen.options))
        left_out |= set() if values["method"] == "ps" else {"order"}
    for owner in (target.options, *families):
        for name, option_ in options_of(owner).items():
            other, _ = option_.implies or ("", "")
            if other in typed and values[other] != OPEN and not option_.applies_with(values[other]):
                left_out.add(name)
    return {n: None if n in left_out & written else value for n, value in values.items()}


def _filter_of(method: str | None, target: Target, opens: bool) -> Filter:
    """The filter that --method or --detections selects."""
    able_families = [family for family in filters.all_filters().values() if family.opens]
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
