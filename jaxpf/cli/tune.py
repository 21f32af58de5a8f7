"""``jaxpf tune``: parameters of the likelihood and the motion, found by gradient descent."""

import dataclasses
import sys
from pathlib import Path
from typing import Any

import click

from jaxpf import filters
from jaxpf.cli import common
from jaxpf.cli.memory import check_memory, needed_by
from jaxpf.cli.options import declared_options, picked, refuse_others
from jaxpf.errors import InputError
from jaxpf.names import GRADIENTS, OBJECTIVES
from jaxpf.options import OPEN, chosen, counting, options_of
from jaxpf.targets import targets
from jaxpf.targets.target import is_filmed

_NOT_REPEATED = ("config", "output")
#: Without a terminal, progress is told so often.
_STEPS_PER_LINE = 10


@click.command("tune")
@click.argument("scene", metavar="SCENE_OR_FOLDER")
@click.option(
    "--parameters",
    help="Paths in the tracker, each perhaps with bounds: likelihood.sharpness=1:500.  [default: "
    "the sharpness and the noise of the position]",
)
@click.option(
    "--objective",
    default="evidence",
    show_default=True,
    help="evidence (needs no labels), position or overlap (from the truth).",
)
@declared_options(without=("order", "swap", "ess_threshold"), defaults={"particles": 100})
@click.option(
    "--target", help=f"What the objects are: {', '.join(targets())}.  [default: by the scene]"
)
@click.option(
    "--gradient",
    default="stop_gradient",
    show_default=True,
    help="Through resampling: stop_gradient (unbiased), none (less noise), soft or transport.",
)
@click.option("--steps", default=150, show_default=True, help="At most, per repeat.")
@click.option("--learning-rate", default=0.1, show_default=True, help="0.1: up to 10 % per step.")
@click.option("--runs", default=2, show_default=True, help="Runs per sequence and step.")
@click.option("--sequences-per-step", default=1, show_default=True, help="Scenes per step.")
@click.option(
    "--random-numbers",
    default="fresh",
    show_default=True,
    help="fresh at every step, or common to all steps.",
)
@click.option("--clip", default=10.0, show_default=True, help="Longest gradient.")
@click.option("--window", default=20, show_default=True, help="Steps that are averaged.")
@click.option(
    "--tolerance",
    default=0.02,
    show_default=True,
    help="Stop when values change by less than this share from window to window.",
)
@click.option("--repeats", default=3, show_default=True, help="Descents with seeds of their own.")
@click.option("--seed", default=0, show_default=True, help="Seed of everything random.")
@click.option("--scene-seed", default=0, show_default=True, help="First seed of synthetic scenes.")
@click.option("--train-scenes", default=3, show_default=True, help="Synthetic scenes to tune on.")
@click.option(
    "--held-out", default=10, show_default=True, help="Further synthetic scenes to compare on."
)
@click.option(
    "--set", "settings", multiple=True, metavar="NAME=VALUE", help="A parameter of the scenes."
)
@click.option("--ids", type=common.NumberList(int), help="Objects of a folder's truth.")
@click.option("--start-frame", type=int, help="Of a folder, from 0.")
@click.option(
    "--frames",
    type=int,
    help="Of a folder: frames to tune on, the start frame included; the comparison is on those "
    "after them.  [default: half]",
)
@click.option(
    "--labels",
    type=int,
    help="Labelled frames, evenly spread, for position and overlap.  [default: all]",
)
@click.option("--compare-runs", default=20, show_default=True, help="Runs of the comparison.")
@click.option(
    "--compare-particles", default=300, show_default=True, help="Particles of the comparison."
)
@click.option(
    "--output",
    "-o",
    type=click.Path(path_type=Path),
    help="Folder for the results, which a second call continues.  [default: jaxpf-tune-NAME]",
)
@common.config_option()
def command(**options: Any) -> None:
    """Tune parameters on SCENE_OR_FOLDER, and compare before and after on what was not seen.

    SCENE_OR_FOLDER is, as for `jaxpf evaluate`, a synthetic scene, a folder with a sequence and
    its truth, or file.py:function.  Synthetic scenes are tuned on some seeds and compared on
    others; a folder is tuned on its first frames and compared on the rest, starting there
    from the truth.

    The output folder receives tuned.toml, which `jaxpf track` and `jaxpf evaluate` take as
    --config, comparison.csv, tuning.png with the traces, and a checkpoint: the same command
    continues what was interrupted.

    Example: jaxpf tune distracter --parameters likelihood.sharpness,dynamics.scale
    """
    _check(options)
    from jaxpf.cli.tune_output import (
        COMPARISON,
        TRACES,
        TUNED,
        compare_before_and_after,
        show,
        write_traces,
        write_tuned,
    )
    from jaxpf.cli.tune_scenes import divided_scenes
    from jaxpf.files.writing import prepare_output_folder, report_os_errors
    from jaxpf.tuning.checkpoint import NAME

    output = options["output"] or Path(f"jaxpf-tune-{common.scene_name(options['scene'])}")
    with report_os_errors("write into the output folder", output):
        continues = (output / NAME).is_file()
    train, unseen = divided_scenes(options)
    # A gradient goes back through all frames: they are in memory here and on the device.
    of_frames = 2 * sum(scene.frames.nbytes for scene in train)
    remedy = "ask for fewer particles (-n), --runs or --frames"
    check_memory(of_frames, remedy)
    common.start_jax()
    from jaxpf import tuning
    from jaxpf.tuning.sequences import training_sequence

    its = {field.name for field in dataclasses.fields(tuning.Settings)} & set(options)
    settings = tuning.Settings(**{name: options[name] for name in its})
    before = _recipe(options, train[0])
    own = chosen(before.of.options, before.values)
    usual = before.of.tuned_by_default(own)
    options["parameters"] = options["parameters"] or ",".join(usual)
    wanted = [tuning.parameter(text) for text in common.names_in(options["parameters"])]
    sequences = [
        training_sequence(scene, before, options["objective"], options["labels"]) for scene in train
    ]
    _check_parameters(sequences[0].tracker, before.of, wanted)
    longest = max(len(sequence.frames) for sequence in sequences)
    check_memory(of_frames + needed_by(sequences[0].tracker, settings.runs, longest), remedy)
    if not continues:
        prepare_output_folder(output)
    try:
        result = _tune(sequences, wanted, settings, options["objective"], output)
    except tuning.Diverged as error:
        write_tuned(output / TUNED, error.result, error.result.last_good, before)
        raise InputError(f"{error} They are kept in '{output / TUNED}'.") from None
    except KeyboardInterrupt:
        click.echo(
            f"The steps so far are kept in '{output}'; the same command continues.", err=True
        )
        raise
    # In the order of the help: the same tuning writes the same file, however it was typed.
    names = [str(param.name) for param in click.get_current_context().command.params]
    repeated = {name: options[name] for name in names if name not in _NOT_REPEATED}
    common.write_config(output / "run.toml", "tune", repeated)
    write_tuned(output / TUNED, result, result.values, before)
    write_traces(output / TRACES, result, options["objective"])
    show(result)
    compare_before_and_after(output, unseen, before, before.with_values(result.values), options)
    click.echo(f"{output}/: {TUNED}, {TRACES}, {COMPARISON}, run.toml")


def _tune(
    sequences: list[Any], wanted: list[Any], settings: Any, objective: str, output: Path
) -> Any:
    """Tune behind a progress bar, or, where no terminal shows one, with a line now and then."""
    from jaxpf import tuning

    shows_bars = sys.stderr.isatty()
    with common.progress_bar("steps") as bar:
        task = bar.add_task("tuning", total=settings.steps * settings.repeats)

        def progress(descent: Any) -> None:
            done = settings.steps if descent.stopped else descent.num_steps
            bar.update(
                task,
                completed=descent.repeat * settings.steps + done,
                description=f"repeat {descent.repeat + 1}, loss {descent.loss[-1]:.4g}",
            )
            if not shows_bars and (descent.stopped or descent.num_steps % _STEPS_PER_LINE == 0):
                click.echo(
                    f"repeat {descent.repeat + 1} of {settings.repeats}: step {descent.num_steps} "
                    f"of at most {settings.steps}, loss {descent.loss[-1]:.4g}",
                    err=True,
                )

        return tuning.tune(
            sequences,
            wanted,
            objective=objective,
            settings=settings,
            folder=output,
            progress=progress,
        )


def _check_parameters(tracker: Any, target: Any, wanted: list[Any]) -> None:
    """Refuse what `jaxpf track` and `jaxpf evaluate` have no option for."""
    from jaxpf import tuning
    from jaxpf.tuning.parameters import check_apart

    if not wanted:
        raise InputError(
            "--parameters names none; name at least one, such as likelihood.sharpness."
        )
    check_apart(wanted)
    tunable = [option.path for option in options_of(target.options).values() if option.path]
    for one in wanted:
        tuning.read(tracker, one)
        if one.name not in tunable:
            raise InputError(
                f"the parameter {one.path} has no option in `jaxpf track` and `jaxpf evaluate`; "
                f"tune it in Python with jaxpf.tune, or choose among {', '.join(tunable)}."
            )


def _check(options: dict[str, Any]) -> None:
    for name, valid in (
        ("gradient", GRADIENTS),
        ("objective", OBJECTIVES),
    ):
        if options[name] not in valid:
            raise InputError(
                f"--{name} {options[name]!r} is unknown; choose one of {', '.join(valid)}."
            )
    for name in ("compare_particles", "train_scenes", "held_out"):
        if options[name] < 1:
            raise InputError(f"--{name.replace('_', '-')} {options[name]} must be at least 1.")
    if options["compare_runs"] < 2:
        raise InputError(f"--compare-runs {options['compare_runs']} must be at least 2.")
    options["scene"] = common.resolved_scene(options["scene"])


def _recipe(options: dict[str, Any], scene: Any) -> Any:
    """What the tracker is made of, before tuning."""
    from jaxpf.evaluation.settings import target_for
    from jaxpf.tuning.sequences import Recipe

    target = target_for(options["target"], scene)
    method = options["method"] or target.defaults.get("method")
    its = filters.filter_of(method) if method else next(iter(filters.filters().values()))
    refuse_others(options, target.options, its.options)
    named = {
        text.partition("=")[0].partition("[")[0]
        for text in common.names_in(options["parameters"] or "")
    }
    for one in options_of(target.options).values():
        # Who names a parameter says of what kind the tracker is.
        if one.path in named and one.implies and options.get(one.implies[0]) in (None, OPEN):
            options[one.implies[0]] = one.implies[1]
    model = target.resolved(picked(options, target.options), is_filmed(scene))
    both = (picked(options, its.options, {"particles": 100, **target.defaults}), model)
    values = {name: getattr(one, name) for one in both for name in options_of(one)}
    counts = {name: does for one in both for name, does in counting(one).items()}
    options |= {name: values[name] if counts[name] else None for name in values if name in options}
    return Recipe(target.name, values, gradient=options["gradient"])
