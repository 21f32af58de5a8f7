"""``jaxpf track``: objects through a video, to tracks on disk."""

import contextlib
import dataclasses
import functools
from pathlib import Path
from typing import Any, NamedTuple

import click
import numpy as np

from jaxpf import filters
from jaxpf.cli import births as births_of
from jaxpf.cli import common, motion
from jaxpf.cli.live import check_live, open_window, start_when_compiled, used_to_the_light
from jaxpf.cli.memory import check_memory, needed_by
from jaxpf.cli.options import (
    all_options,
    declared_options,
    options_of_owner,
    picked,
    refuse_others,
    start_options,
    target_of,
)
from jaxpf.cli.population_recorder import PopulationRecorder
from jaxpf.cli.recorder import Recorder
from jaxpf.cli.stopping import announced_stop
from jaxpf.errors import InputError
from jaxpf.files.locking import locked
from jaxpf.media.video_writer import SUFFIXES
from jaxpf.options import counting, options_of
from jaxpf.targets import targets
from jaxpf.targets.lifetimes import Rules
from jaxpf.targets.target import Looks, Start, Target

#: Where a method has a number of its own, by which histograms choose their way.
_PARTICLES = 300
#: Options that run.toml leaves out; --method tells the filter.
_NOT_REPEATED = ("config", "output", "overwrite", "filter_", "preview", "fit_motion")
#: Everything that a run may leave in its output folder.
_OUTPUTS = (
    "tracks.csv",
    "overlay.mp4",
    "overlay.webm",
    "diagnostics.csv",
    "diagnostics.png",
    "metrics.csv",
    "summary.json",
    "run.toml",
)


@click.command("track")
@click.argument("video")
@start_options()
@click.option("--target", help=f"What is tracked: {', '.join(targets())}.  [default: by its start]")
@click.option(
    "--filter",
    "filter_",
    help=f"How guesses are organised: {', '.join(filters.filters())}.  [default: by --method]",
)
@click.option("--start", default=0, show_default=True, help="Start frame, counting from 0.")
@click.option("--frames", type=int, help="Track at most this many frames after the start.")
@declared_options()
@options_of_owner(Rules)
@click.option(
    "--tracker",
    metavar="FILE.py:FUNCTION",
    help="A tracker of your own: a function of the scene, here the start frame and its boxes.",
)
@motion.option()
@click.option("--seed", default=0, show_default=True, help="Random seed: same seed, same tracks.")
@click.option(
    "--truth", type=click.Path(path_type=Path), help="CSV as for --boxes: adds a metrics table."
)
@click.option(
    "--output",
    "-o",
    type=click.Path(path_type=Path),
    help="Folder for the results.  [default: jaxpf-NAME]",
)
@click.option("--overwrite", is_flag=True, help="Replace files in an existing folder.")
@click.option(
    "--overlay/--no-overlay", default=True, help="Write the overlay video.  [default: on]"
)
@click.option(
    "--codec",
    default="h264",
    show_default=True,
    help="Of the overlay: h264 (overlay.mp4), or vp9 (overlay.webm, smaller and slower to write).",
)
@click.option(
    "--preview",
    is_flag=True,
    help="Show the overlay in a window while it is made, where there is a screen.",
)
@common.config_option()
def command(**options: Any) -> None:
    """Track objects through VIDEO: a video file, a folder of images, or what is live.

    Live are the index of a camera (0 is the first), the address of a stream that OpenCV opens
    (http://, rtsp://, ...) and a pipe: they are tracked until they end or Ctrl-C is pressed, which
    keeps all results.  A stream's start frame is its first one.  A camera's is taken once
    everything is compiled: the objects must be at their boxes until a line says that tracking
    begins.  `jaxpf frame 0 -n 30` shows what camera 0 sees.

    The start boxes come from --box (repeated) or from --boxes with --ids, the parts of an
    articulated object from --parts-file, contours from --contours; with --births boxes start and
    end by a file of detections, and need no start box.  Filtering begins with the frame after the
    start frame.  The output folder receives tracks.csv (MOT format; of parts, in the columns
    frame,part,x,y,w,h,angle; of contours frame,contour,kind,point,x,y), overlay.mp4,
    diagnostics.csv and .png, summary.json, and run.toml, which repeats the run:
    `jaxpf track --config run.toml -o ANOTHER`.

    Example: jaxpf track clip.mp4 --box 120,80,40,90 --box 300,85,42,88
    """
    _prefer_command_line(options)
    target = target_of(options)
    births = births_of.read_births(options)
    setup = _setup(options, target, births)
    _check_options(options, target)
    motion.check_fit(options, target, setup.model, births is not None)
    from jaxpf.files import writing
    from jaxpf.media.video import open_frames

    source = open_frames(options["video"])
    options["video"] = source.path  # without a password, since results are passed on
    frames = source.frames(options["start"])
    click.get_current_context().call_on_close(frames.close)
    check_live(options, source)
    window = open_window(source) if options["preview"] else None
    first = used_to_the_light(frames) if source.is_camera else next(frames)
    start = target.read_start(options, options["start"], source)
    for remark in start.remarks:
        click.echo(f"Note: {remark}", err=True)
    if births is not None:
        births_of.check_births(births, start, options["start"], source)
    truth = _read_truth(options, None if births is not None else start.ids)
    output = options["output"] or Path(f"jaxpf-{source.name}")
    if isinstance(source.path, Path):
        _check_output(output, source.path)
    common.use_compile_cache()
    import jax

    if births is not None:
        tracker = births_of.open_tracker(births, target, *setup, first)
    else:
        tracker = _build_tracker(options, target, setup, start, source, first)
    check_memory(needed_by(tracker), "ask for fewer particles (-n)")
    if options["fit_motion"] is not None:
        looks = _looks(options, first)
        model, told, frames = motion.fitted(options, target, setup, start, looks, frames)
        click.echo(f"Note: {told}", err=True)
        _fill_in(options, model)  # run.toml and summary.json tell what was found
        setup = setup._replace(model=model)
        start = dataclasses.replace(start, remarks=(*start.remarks, told))
        tracker = _build_tracker(options, target, setup, start, source, first)
    existed = output.is_dir()
    writing.prepare_output_folder(output, options["overwrite"])

    recorder = None
    stopped: KeyboardInterrupt | InputError | None = None
    with locked(output, "tracking", keep=False):
        try:
            _remove_outputs(output)
            _write_repeatable_options(output, options, target)
            if source.is_camera:
                make = functools.partial(_build_tracker, options, target, setup, start, source)
                tracker, first = start_when_compiled(make, tracker, first, frames, source)
            made = output, source, options, target, start, tracker
            if births is None:
                recorder = Recorder(*made, None if options["tracker"] else setup.filter.check_first)
            else:
                recorder = PopulationRecorder(*made, births)
            recorder.window = window
            saying = "Finishing: what was tracked is being written."
            with announced_stop(saying), recorder, contextlib.closing(frames):
                recorder.start(options["start"], first)
                recorder.follow(jax.random.key(options["seed"]), frames)
        except (KeyboardInterrupt, InputError) as error:
            stopped = error
        kept = recorder is not None and (stopped is None or recorder.num_tracked > 0)
        if recorder is not None and kept:
            # What was tracked stays; the first error matters more than another one at the end.
            with contextlib.suppress(*([] if stopped is None else [InputError])):
                recorder.finish(stopped, truth)
        else:
            _remove_outputs(output)
    if not kept and not existed:
        # Nothing was tracked: leave no half-made folder behind.
        with contextlib.suppress(OSError):
            output.rmdir()
    if stopped is not None:
        raise stopped


class _Setup(NamedTuple):
    """The options of a run, of its target and of its filter."""

    filter: Any
    model: Any
    filter_options: Any


def _setup(options: dict[str, Any], target: Target, births: births_of.Births | None) -> _Setup:
    """Check the options, and fill in those that were not given."""
    known = filters.filters()
    if options["filter_"] and options["filter_"] not in known:
        raise InputError(
            f"--filter {options['filter_']!r} is unknown; choose one of {', '.join(known)}."
        )
    its = known[options["filter_"]] if options["filter_"] else None
    if births is not None and its is None and not options["method"]:
        its = next(one for one in known.values() if one.opens)
    method = options["method"] or (target.defaults.get("method") if its is None else None)
    if its is not None and method and method not in its.methods:
        raise InputError(
            f"--method {method} is not of the filter {its.name}, which has "
            f"{', '.join(its.methods)}; leave one of them out."
        )
    if its is None:
        its = filters.filter_of(method) if method else next(iter(known.values()))
    if births is not None and not its.opens:
        able = ", ".join(name for name, one in known.items() if one.opens)
        raise InputError(
            f"--births needs a filter whose objects may come and go, and {its.name} is not one; "
            f"use --filter {able}."
        )
    refuse_others(options, target.options, its.options)
    of_filter, of_target = births_of.defaults_of(births, target)
    defaults = {**target.defaults, **of_filter}
    if defaults.get("method") not in its.methods:
        defaults = {name: value for name, value in defaults.items() if name != "method"}
    filter_options = picked(options, its.options, defaults)
    # Who comes later is not in the start frame: nothing can be learned there.
    model = target.resolved(picked(options, target.options, of_target), is_filmed=births is None)
    _fill_in(options, filter_options, model)
    return _Setup(its, model, filter_options)


def _fill_in(options: dict[str, Any], *chosen: Any) -> None:
    """Write what was chosen into the options, as people write it; None where it does not count."""
    for one in chosen:
        counts = counting(one)
        for name, option in options_of(one).items():
            value: Any = getattr(one, name) if counts[name] else None
            # As people write it, for the file that repeats the run.
            places = option.places and value is not None
            options[name] = [place + 1 for place in value] if places else value


def _prefer_command_line(options: dict[str, Any]) -> None:
    """Drop what the configuration says where the command line says something that excludes it."""
    source = click.get_current_context().get_parameter_source

    def typed(name: str) -> bool:
        return source(name) is click.core.ParameterSource.COMMANDLINE

    every = {name: one.start_flags for name, one in targets().items()}
    ours = [name for name, flags in every.items() if any(map(typed, flags))]
    if ours and not typed("target"):
        options["target"] = None
        used = options_of(*(filter_.options for filter_ in filters.filters().values()))
        used |= options_of(*(targets()[name].options for name in ours))
        options |= {name: None for name in all_options() if name not in used and not typed(name)}
    for name, flags in every.items():
        if ours and name not in ours:
            options |= {flag: None for flag in flags if not typed(flag)}
    if typed("box") and not typed("boxes"):
        options["boxes"] = None
        if not typed("ids"):
            options["ids"] = None
    if typed("boxes") and not typed("box"):
        options["box"] = ()
    if typed("method") and options["method"] != "ps" and not typed("order"):
        options["order"] = None


def _check_options(options: dict[str, Any], target: Target) -> None:
    if options["codec"] not in SUFFIXES:
        raise InputError(
            f"--codec {options['codec']!r} is unknown; choose one of {', '.join(SUFFIXES)}."
        )
    if options["start"] < 0:
        raise InputError(f"--start {options['start']} must be at least 0.")
    if options["frames"] is not None and options["frames"] < 1:
        raise InputError(f"--frames {options['frames']} must be at least 1.")
    if not 0 <= options["seed"] < 2**32:
        raise InputError(f"--seed {options['seed']} must be between 0 and {2**32 - 1}.")
    for name in ("truth", "tracker"):
        if options[name] and not target.has_boxes:
            raise InputError(
                f"--{name} is about boxes, and {target.name} are tracked; leave it out."
            )


def _read_truth(options: dict[str, Any], ids: np.ndarray | None) -> Any:
    """The table of --truth, which must say something about this run; of all ids where None."""
    if options["truth"] is None:
        return None
    from jaxpf.files.tracks import read_boxes

    truth = read_boxes(options["truth"], empty_boxes="absent")
    ids = np.unique(truth.id) if ids is None else ids
    names = ", ".join(map(str, ids))
    ours = np.isin(truth.id, ids)
    if not ours.any():
        raise InputError(
            f"--truth {truth.source} has no box of object {names}, which this run tracks; give "
            "the truth of these objects, or leave it out."
        )
    start, limit = options["start"], options["frames"]
    after = truth.frame[ours] > start
    if limit is not None:
        after &= truth.frame[ours] <= start + limit
    if not after.any():
        until = "" if limit is None else f" to {start + limit}"
        raise InputError(
            f"--truth {truth.source} has no box of object {names} in the frames from "
            f"{start + 1}{until} (counting from 0); give another start, or leave it out."
        )
    return truth


def _build_tracker(
    options: dict[str, Any],
    target: Target,
    setup: _Setup,
    start: Start,
    source: Any,
    first: np.ndarray,
) -> Any:
    """The built-in method's tracker, which learns from the start frame, or the user's own."""
    if options["tracker"]:
        from jaxpf.experiments.sources import own_tracker_of, start_scene

        return own_tracker_of(
            options["tracker"], start_scene(source.name, first, start.shapes, source.fps)
        )
    setup.filter.check(setup.filter_options, start.parents)
    model = target.model(setup.model, start, _looks(options, first))
    return setup.filter.tracker(model, setup.filter_options)


def _looks(options: dict[str, Any], first: np.ndarray) -> Looks:
    """What likelihoods are learned from: the start frame."""
    particles = options["particles"] or _PARTICLES
    return Looks(first, None, first.shape[:2], particles, typical=first[None])


def _check_output(output: Path, video: Path) -> None:
    """Refuse to write among the frames, or over the video, that the run reads."""
    folder, video = output.resolve(), video.resolve()
    if folder == video or (folder == video.parent and video.name in _OUTPUTS):
        raise InputError(
            f"output folder '{output}' would mix the results with the video '{video}' itself; "
            "choose another --output."
        )


def _remove_outputs(output: Path) -> None:
    """Remove the files of a run, and no others."""
    from jaxpf.files.writing import report_os_errors

    for name in _OUTPUTS:
        with report_os_errors("replace", output / name):
            (output / name).unlink(missing_ok=True)


def _write_repeatable_options(output: Path, options: dict[str, Any], target: Target) -> None:
    # In the order of the help: the same run writes the same file, however it was typed.
    names = [str(param.name) for param in click.get_current_context().command.params]
    repeatable = {name: options[name] for name in names if name not in _NOT_REPEATED}
    repeatable["target"] = target.name
    repeatable = {
        name: value.resolve() if isinstance(value, Path) else value
        for name, value in repeatable.items()
        if value != ()
    }
    common.write_config(output / "run.toml", "track", repeatable)
