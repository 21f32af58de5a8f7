"""What ``jaxpf track`` was asked for: checked, complete, and fit to be repeated."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from jaxpf import filters
from jaxpf.cli.shared.flags import as_typed, picked, refuse_others
from jaxpf.cli.tracking.births import Births, defaults_of, read_births
from jaxpf.contract.errors import InputError, check_known
from jaxpf.contract.options import OPEN, check_options, option, options_of
from jaxpf.files.writing import check_output_file
from jaxpf.media.video_writer import SUFFIXES
from jaxpf.targets.adapter import Adapter
from jaxpf.targets.target import Target

#: Frames that a video may have.
_MOST_FRAMES = 2**31 - 1
#: Of --fit-motion: so many hold a walk or a throw; fewer leave the evidence undecided.
LEAST_FITTED = 5
#: Options of a run that say where results go or how they are watched, not what they are; what
#: --fit-motion found stands in the options of the model.
_NOT_REPEATED = ("output", "overwrite", "preview", "fit_motion", "save_state")
#: What is typed of these replaces the start of a configuration; of others it adds to it.
_ADDS_TO_START = ("ids", "mask_step", "learned")


@dataclasses.dataclass(frozen=True)
class Run:
    """Options of ``jaxpf track`` whatever is tracked; see the help of each."""

    start: int = option(0, "Start frame, counting from 0.", least=0, most=_MOST_FRAMES)
    frames: int | None = option(
        None, "Track at most this many frames after the start.", least=1, most=_MOST_FRAMES
    )
    fit_motion: int | None = option(
        None,
        "Choose noise and momentum by so many frames, as 30.  Their evidence decides; they follow "
        "the start frame, and run.toml keeps what was found.",
        least=LEAST_FITTED,
        most=_MOST_FRAMES,
    )
    seed: int = option(0, "Random seed: same seed, same tracks.", least=0, most=2**32 - 1)
    runs: int | None = option(
        None,
        "Track so many times: their mean, and its error.  Runs go side by side; uncertainty.csv "
        "holds standard errors.  Ten cost two to nine times as much as one.",
        least=2,
        most=10_000,
    )
    error_bars: int | None = option(
        None,
        "Monte-Carlo error from one run, by ancestors so many frames back, such as 2; empty where "
        "too few are left.",
        least=1,
        most=10_000,
    )
    smooth: bool = option(
        False,
        "Look back when the clip ends: smoothed.csv tells where objects were, given all frames, "
        "and smoothed_uncertainty.csv how sure that is.",
    )
    smooth_lag: int | None = option(
        None,
        "Smooth by so many frames ahead at least, such as 50, instead of by all; for long clips.",
        least=1,
        most=_MOST_FRAMES,
    )
    save_state: Path | None = option(  # noqa: RUF009
        None, "File for the state in which the last frame leaves the filter, for --resume."
    )
    resume: Path | None = option(  # noqa: RUF009
        None,
        "State of --save-state: go on after its frames, with the other options as they were; the "
        "tracks are those of one run through all.",
    )
    output: Path | None = option(  # noqa: RUF009
        None,
        "Folder for the results; jaxpf-NAME by default.",
        flags=("-o",),
    )
    overwrite: bool = option(False, "Replace files in an existing folder.")
    overlay: bool = option(True, "Write the overlay video.")
    codec: str = option(
        "h264",
        "Of the overlay: h264 (overlay.mp4), or vp9 (overlay.webm, smaller and slower to write).",
        choices=tuple(SUFFIXES),
    )
    preview: bool = option(
        False, "Show the overlay in a window while it is made.  This needs a screen."
    )
    truth: Path | None = option(  # noqa: RUF009
        None, "CSV as for --boxes: adds a metrics table."
    )
    tracker: str | None = option(
        None,
        "FILE.py:FUNCTION, a tracker of your own: a function of the scene, here the start frame "
        "and its boxes.",
    )

    def __post_init__(self) -> None:
        check_options(self)

    @property
    def smooths(self) -> bool:
        """Whether tracks are smoothed, whole or with a lag."""
        return self.smooth or self.smooth_lag is not None


#: Of a ``Run``, what only boxes have.
OF_BOXES = ("truth", "tracker")


@dataclasses.dataclass(frozen=True)
class Request:
    """A run of ``jaxpf track``.

    Attributes:
        video: a file, a folder, or what is live.
        adapter: of what is tracked.
        starts: values of its ``start_flags``.
        run: options that every target has.
        model: options of the target.
        filter: how guesses are organised.
        filter_options: options of the filter.
        births: who comes and goes; None where all are there from the start.
    """

    video: str | Path
    adapter: Adapter
    starts: Mapping[str, Any]
    run: Run
    model: Any
    filter: Any
    filter_options: Any
    births: Births | None

    @property
    def target(self) -> Target:
        """What is tracked."""
        return self.adapter.target

    @property
    def chooses_order(self) -> bool:
        """Whether pilot runs are to choose the order."""
        return getattr(self.filter_options, "order", None) == OPEN

    def table(self) -> dict[str, Any]:
        """What ``run.toml`` holds: everything that repeats the run, as people write it."""
        found = {"target": self.target.name, "video": self.video, **self.starts}
        found |= {n: v for n, v in as_typed(self.run).items() if n not in _NOT_REPEATED}
        found |= as_typed(self.model) | as_typed(self.filter_options)
        if self.births is not None:
            found |= as_typed(self.births.rules)
        return {
            name: value.resolve() if isinstance(value, Path) else value
            for name, value in found.items()
            if value not in (None, ())
        }


def request_of(ctx: click.Context, adapter: Adapter) -> Request:
    """The request that was typed, or stands in a configuration file.

    Raises:
        InputError: a value out of range, or options that do not go with each other.
    """
    values, target = _given(ctx, adapter), adapter.target
    run = picked(values, Run)
    births = read_births(values)
    its, method = _filter_of(values, target, births is not None)
    refuse_others(values, target, its)
    particles, of_target = defaults_of(births)
    defaults = {**target.defaults, **particles}
    defaults.pop("method", None)
    filter_options = picked(values, its.options, defaults | ({"method": method} if method else {}))
    # Who comes later is not in the start frame: nothing can be learned there.
    model = target.resolved(picked(values, target.options, of_target), is_filmed=births is None)
    starts = {name: values[name] for name in adapter.start_flags}
    request = Request(values["video"], adapter, starts, run, model, its, filter_options, births)
    _check_fit(request)
    _check_uncertainty(request)
    _check_states(request)
    return request


def _check_fit(request: Request) -> None:
    """Refuse to fit the motion, or to choose an order, where there is none.

    Raises:
        InputError: the sentence says why.
    """
    if request.chooses_order and request.run.tracker:
        raise InputError("--order auto is about the built-in filters; leave it or --tracker out.")
    if request.run.fit_motion is None:
        return
    if request.run.tracker:
        raise InputError("--fit-motion is about the built-in motion; leave it or --tracker out.")
    if request.births is not None:
        raise InputError(
            "--fit-motion needs objects that are there in the start frame; leave it or --births "
            "out."
        )


def _check_uncertainty(request: Request) -> None:
    """Refuse errors and smoothing of what has none, or what is asked for twice.

    Raises:
        InputError: the sentence says why.
    """
    asked = {"--runs": request.run.runs, "--error-bars": request.run.error_bars}
    asked = {flag: value for flag, value in asked.items() if value is not None}
    if len(asked) > 1:
        raise InputError(
            "--runs and --error-bars both tell how much another run would differ; use one of them."
        )
    smoothed = {"--smooth": request.run.smooth, "--smooth-lag": request.run.smooth_lag}
    smoothed = {flag: value for flag, value in smoothed.items() if value}
    if smoothed and request.run.runs is not None:
        raise InputError(
            f"{next(iter(smoothed))} looks back over one run, and --runs gives many; leave one of "
            "them out."
        )
    for flag in [*asked, *smoothed]:
        if request.births is not None:
            raise InputError(
                f"{flag} needs objects that are there in every run, and with --births each run may "
                "begin and end others; leave one of them out."
            )
        if request.run.tracker and flag in asked:
            raise InputError(
                f"{flag} is about the built-in filters; leave it out, or put the tracker of "
                f"{request.run.tracker} into jaxpf.filters.SideBySide yourself."
            )


def _check_states(request: Request) -> None:
    """Refuse to save what a filter's state does not hold.

    Raises:
        InputError: the sentence says why.
    """
    run = request.run
    for flag, value in (("--save-state", run.save_state), ("--resume", run.resume)):
        if value is not None and request.births is not None:
            raise InputError(
                f"{flag} is about a filter's state, which does not know whom --births began; "
                "leave one of them out."
            )
    if run.save_state is not None:
        check_output_file(run.save_state, "--save-state")


def _given(ctx: click.Context, adapter: Adapter) -> dict[str, Any]:
    """What was typed, and of the configuration what does not contradict it."""
    values = dict(ctx.params)
    source = {name: ctx.get_parameter_source(name) for name in values}
    typed = {n for n in values if source[n] is click.core.ParameterSource.COMMANDLINE}
    written = {n for n in values if source[n] is click.core.ParameterSource.DEFAULT_MAP}
    left_out: set[str] = set()
    if (typed & set(adapter.start_flags)) - set(_ADDS_TO_START):
        left_out |= set(adapter.start_flags)
    if "method" in typed:
        its = filters.filter_of(values["method"])
        left_out |= set(_of_filters()) - set(options_of(its.options))
    if "method" in typed and values["method"] != "ps":
        left_out.add("order")
    for owner in (adapter.target.options, *(one.options for one in filters.all_filters().values())):
        for name, one in options_of(owner).items():
            other, wanted = one.implies or ("", "")
            if other in typed and values[other] not in (wanted, OPEN):
                left_out.add(name)
    return {n: None if n in left_out & written else value for n, value in values.items()}


def _of_filters() -> dict[str, Any]:
    return options_of(*(one.options for one in filters.all_filters().values()))


def _filter_of(values: Mapping[str, Any], target: Target, opens: bool) -> tuple[Any, str | None]:
    """The filter that was named, by itself or by its method; and the method, where one is meant."""
    known = filters.all_filters()
    name, method = values["filter"], values["method"]
    if name:
        check_known("--filter ", name, known)
    its = known[name] if name else None
    if its is None and opens and not method:
        its = next(one for one in known.values() if one.opens)
    if its is not None and method and method not in its.methods:
        raise InputError(
            f"--method {method} is not of the filter {its.name}, which has "
            f"{', '.join(its.methods)}; leave one of them out."
        )
    method = method or target.defaults.get("method")
    if its is None:
        its = filters.filter_of(method) if method else next(iter(known.values()))
    if opens and not its.opens:
        able = ", ".join(name for name, one in known.items() if one.opens)
        raise InputError(
            f"--births needs a filter whose objects may come and go, and {its.name} is not one; "
            f"use --filter {able}."
        )
    return its, method if method in its.methods else None
