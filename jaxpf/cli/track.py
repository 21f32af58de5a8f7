"""``jaxpf track``: boxes through a video, to tracks on disk."""

import contextlib
import math
import re
from pathlib import Path
from typing import Any

import click
import numpy as np

from jaxpf.cli import common, track_parts
from jaxpf.cli.recorder import Recorder
from jaxpf.errors import InputError

_METHODS = ("sir", "ps", "dps", "sps")
_SCHEMES = ("systematic", "stratified", "multinomial", "residual")
_SWAPS = ("combinatorial", "none", "random", "sorted")
_LIKELIHOODS = ("auto", "integral", "sampled")
_CODECS = ("vp9", "vp8")

#: Everything that a run may leave in its output folder.
_OUTPUTS = (
    "tracks.csv",
    "overlay.webm",
    "diagnostics.csv",
    "diagnostics.png",
    "metrics.csv",
    "summary.json",
    "run.toml",
)


@click.command("track")
@click.argument("video", type=click.Path(path_type=Path))
@click.option("--box", "box", multiple=True, metavar="X,Y,W,H", help="A start box; repeat it.")
@click.option(
    "--boxes",
    type=click.Path(path_type=Path),
    help="CSV of start boxes: MOT format (frames and x, y from 1), or with the header "
    "frame,id,x,y,w,h (from 0).",
)
@click.option("--ids", type=common.NumberList(int), help="Objects of --boxes, such as 1,2,5.")
@click.option(
    "--parts-file",
    type=click.Path(path_type=Path),
    help="Instead of boxes, the parts of an articulated object: CSV with the header "
    "part,parent,x,y,w,h,angle (x, y the centre, angle in degrees clockwise, no parent: root).",
)
@click.option("--start", default=0, show_default=True, help="Start frame, counting from 0.")
@click.option("--frames", type=int, help="Track at most this many frames after the start.")
@click.option(
    "--method",
    default="dps",
    show_default=True,
    help="sir (all objects at once), ps (one after another), dps (ps in as many orders as "
    "objects), sps (side by side, then exchanged between particles).  Parts: sir, ps or sps, "
    "which is then the default.",
)
@click.option(
    "--order",
    type=common.NumberList(int),
    help="For ps, the objects in the order to treat them, the first box being 0: 2,0,1.",
)
@click.option(
    "--swap",
    default="combinatorial",
    show_default=True,
    help=f"How sps exchanges objects: {', '.join(_SWAPS)}.",
)
@click.option("--particles", "-n", default=300, show_default=True, help="Number of particles.")
@click.option("--seed", default=0, show_default=True, help="Random seed: same seed, same tracks.")
@click.option("--resampling", default="systematic", show_default=True, help=", ".join(_SCHEMES))
@click.option(
    "--ess-threshold",
    type=float,
    help="Resample only where the effective sample size is at most this share of the "
    "particles, 0 to 1.  [default: always]",
)
@click.option(
    "--sharpness",
    default=20.0,
    show_default=True,
    help="Likelihood exp(-S d^2) of the colour distance d: larger trusts colours more.",
)
@click.option(
    "--parts",
    default=2,
    show_default=True,
    help="Horizontal bands of a box, each with its own colour histogram.",
)
@click.option(
    "--likelihood",
    default="auto",
    show_default=True,
    help="How histograms are computed: integral, sampled, or auto for the faster of the two.  "
    "Parts: sampled, or patch, which compares pixels and suits grey pictures.",
)
@click.option(
    "--scale",
    type=common.NumberList(float, 3),
    default="4,2,0.003",
    show_default=True,
    help="Noise per frame: x and y in pixels, relative size.  Parts: of the root, x, y and degrees "
    "[default: 3,3,3.5].",
)
@click.option(
    "--joint-scale",
    type=common.NumberList(float, 3),
    default="0.5,0.5,4.5",
    show_default=True,
    help="Parts: noise of a joint, x and y in pixels and degrees.",
)
@click.option(
    "--dynamics",
    default="relative",
    show_default=True,
    help="Parts: relative (they follow their parents) or absolute (each moves on its own).",
)
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
    default="vp9",
    show_default=True,
    help="Of the overlay: vp9, or vp8 (several times faster to write, larger).",
)
@common.config_option()
def command(**options: Any) -> None:
    """Track boxes through VIDEO, a video file or a folder of images.

    The start boxes come from --box (repeated) or from --boxes with --ids, the parts of an
    articulated object from --parts-file.  Filtering begins with the frame after the start
    frame.  The output folder receives tracks.csv (MOT format; of parts, in the columns
    frame,part,x,y,w,h,angle), overlay.webm, diagnostics.csv and .png, summary.json, and
    run.toml, which repeats the run: `jaxpf track --config run.toml -o ANOTHER`.

    Example: jaxpf track clip.mp4 --box 120,80,40,90 --box 300,85,42,88
    """
    _prefer_command_line(options)
    _check_options(options)
    from jaxpf.files import writing as files
    from jaxpf.media.video import open_frames

    source = open_frames(options["video"])
    frames = source.frames(options["start"])
    first = next(frames)
    parts = truth = None
    if options["parts_file"]:
        parts = track_parts.start_parts(options, source.width, source.height)
    else:
        ids, boxes = _start_boxes(options, source)
        truth = _read_truth(options, ids)
    output = options["output"] or Path(f"jaxpf-{source.name}")
    _check_output(output, source.path)
    common.use_compile_cache()
    import jax

    if parts is None:
        tracker = _build_tracker(options, first, ids, boxes)
    else:
        tracker = track_parts.build_tracker(options, first, parts)
    existed = output.is_dir()
    files.prepare_output_folder(output, options["overwrite"])

    recorder = None
    stopped: KeyboardInterrupt | InputError | None = None
    try:
        _remove_outputs(output)
        _write_repeatable_options(output, options)
        if parts is None:
            recorder = Recorder(output, source, options, ids, boxes, tracker)
        else:
            recorder = track_parts.PartRecorder(output, source, options, parts, tracker)
        with recorder:
            recorder.start(options["start"], first)
            recorder.follow(jax.random.key(options["seed"]), frames)
    except (KeyboardInterrupt, InputError) as error:
        stopped = error
    if recorder is not None and (stopped is None or recorder.num_tracked > 0):
        # What was tracked stays; the first error matters more than another one at the end.
        with contextlib.suppress(*([] if stopped is None else [InputError])):
            recorder.finish(stopped, truth)
    else:
        # Nothing was tracked: leave no half-made folder behind.
        _remove_outputs(output)
        if not existed:
            with contextlib.suppress(OSError):
                output.rmdir()
    if stopped is not None:
        raise stopped


def _prefer_command_line(options: dict[str, Any]) -> None:
    """Drop what the configuration says where the command line says something that excludes it."""
    source = click.get_current_context().get_parameter_source

    def typed(name: str) -> bool:
        return source(name) is click.core.ParameterSource.COMMANDLINE

    if typed("box") and not typed("boxes"):
        options["boxes"] = None
        if not typed("ids"):
            options["ids"] = None
    if typed("boxes") and not typed("box"):
        options["box"] = ()
    if typed("parts_file"):
        options |= {name: None for name in ("box", "boxes", "ids") if not typed(name)}
    elif typed("box") or typed("boxes"):
        options["parts_file"] = None
    if typed("method") and options["method"] != "ps" and not typed("order"):
        options["order"] = None


def _check_options(options: dict[str, Any]) -> None:
    likelihoods = _LIKELIHOODS
    if options["parts_file"]:
        track_parts.complete(options)
        likelihoods = track_parts.LIKELIHOODS
    for name, valid in (
        ("method", _METHODS),
        ("resampling", _SCHEMES),
        ("swap", _SWAPS),
        ("likelihood", likelihoods),
        ("codec", _CODECS),
    ):
        if options[name] not in valid:
            raise InputError(
                f"--{name} {options[name]!r} is unknown; choose one of {', '.join(valid)}."
            )
    for name, least in (("start", 0), ("particles", 1), ("parts", 1)):
        if options[name] < least:
            raise InputError(f"--{name} {options[name]} must be at least {least}.")
    if options["particles"] >= 2**31:
        raise InputError(f"--particles {options['particles']} must be below {2**31}.")
    if options["frames"] is not None and options["frames"] < 1:
        raise InputError(f"--frames {options['frames']} must be at least 1.")
    if not 0 <= options["seed"] < 2**32:
        raise InputError(f"--seed {options['seed']} must be between 0 and {2**32 - 1}.")
    if not 0 < options["sharpness"] < math.inf:
        raise InputError(f"--sharpness {options['sharpness']} must be positive and finite.")
    if options["order"] is not None and options["method"] != "ps":
        raise InputError(
            f"--order was given, but method {options['method']!r} has none; add --method ps."
        )
    if options["ess_threshold"] is not None and not 0 <= options["ess_threshold"] <= 1:
        raise InputError(
            f"--ess-threshold {options['ess_threshold']} must be a share between 0 and 1."
        )


def _start_boxes(options: dict[str, Any], source: Any) -> tuple[np.ndarray, np.ndarray]:
    from jaxpf.files import tracks

    if options["box"] and options["boxes"]:
        raise InputError("--box and --boxes were both given; use one of them.")
    if options["ids"] is not None and not options["boxes"]:
        raise InputError("--ids names objects of a CSV file; give the file with --boxes.")
    if options["boxes"]:
        ids, boxes = tracks.start_boxes(
            tracks.read_boxes(options["boxes"]), options["start"], options["ids"]
        )
    elif options["box"]:
        boxes = np.stack([tracks.parse_box(text) for text in options["box"]])
        ids = np.arange(1, len(boxes) + 1)
    else:
        raise InputError(
            "no start box: give --box x,y,w,h for every object, or --boxes FILE.csv "
            f"(`jaxpf frame {source.path}` saves a frame with a pixel grid to read them off)."
        )
    tracks.check_boxes(boxes, source.width, source.height, [f"object {i}" for i in ids])
    return ids, boxes


def _read_truth(options: dict[str, Any], ids: np.ndarray) -> Any:
    """The table of --truth, which must say something about this run."""
    if options["truth"] is None:
        return None
    from jaxpf.files.tracks import read_boxes

    truth = read_boxes(options["truth"], empty_boxes="absent")
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
    options: dict[str, Any], first: np.ndarray, ids: np.ndarray, boxes: np.ndarray
) -> Any:
    from jaxpf.models.likelihoods.histogram import histogram
    from jaxpf.targets.boxes import box_tracker, ordering_of

    order = options["order"]
    if order is not None and sorted(order) != list(range(len(boxes))):
        raise InputError(
            f"--order {','.join(map(str, order))} is not a permutation of the {len(boxes)} "
            f"object(s); name each of 0 to {len(boxes) - 1} once."
        )
    if options["method"] == "dps" and options["particles"] < len(boxes):
        raise InputError(
            f"--particles {options['particles']} is fewer than the {len(boxes)} components of "
            f"dps, one per object; give at least {len(boxes)}, better some hundreds."
        )
    try:
        likelihood = histogram(
            first,
            boxes,
            sharpness=options["sharpness"],
            parts=options["parts"],
            method=options["likelihood"],
            num_particles=options["particles"],
        )
    except InputError as error:
        # The library counts its boxes from 0; people know their objects by id.
        named = re.sub(
            r"boxes\[(\d+)\]", lambda match: f"the box of object {ids[int(match[1])]}", str(error)
        )
        raise InputError(named) from None
    ordering = ordering_of(
        options["method"], len(boxes), order=options["order"], swap=options["swap"]
    )
    return box_tracker(
        likelihood,
        boxes,
        ordering,
        scale=options["scale"],
        num_particles=options["particles"],
        resampling=options["resampling"],
        ess_threshold=options["ess_threshold"],
    )


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


def _write_repeatable_options(output: Path, options: dict[str, Any]) -> None:
    # In the order of the help: the same run writes the same file, however it was typed.
    names = [str(param.name) for param in click.get_current_context().command.params]
    repeatable = {
        name: options[name] for name in names if name not in ("config", "output", "overwrite")
    }
    for name in ("video", "boxes", "parts_file", "truth"):
        if repeatable[name] is not None:
            repeatable[name] = repeatable[name].resolve()
    common.write_config(output / "run.toml", "track", repeatable)
