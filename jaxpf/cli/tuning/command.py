"""``jaxpf tune``: parameters of the likelihood and the motion, found by gradient descent."""

import dataclasses
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from jaxpf import filters
from jaxpf.cli.shared.config import write_config
from jaxpf.cli.shared.console import progress_bar
from jaxpf.cli.shared.flags import as_typed, picked, refuse_others
from jaxpf.cli.shared.scene_options import (
    SceneCommand,
    SceneOptions,
    names_in,
    resolved_scene,
    scene_name,
)
from jaxpf.cli.shared.startup import start_jax
from jaxpf.contract.errors import InputError
from jaxpf.contract.names import GRADIENTS, OBJECTIVES
from jaxpf.contract.options import OPEN, check_options, chosen, option, options_of
from jaxpf.running.memory import check_memory, needed_by
from jaxpf.targets import adapter_of_scene
from jaxpf.targets.adapter import is_filmed

#: Particles of a run, where nobody says how many: a gradient costs more than a run.
_PARTICLES = 100
#: Without a terminal, progress is told so often.
_STEPS_PER_LINE = 10


@dataclasses.dataclass(frozen=True)
class Scenes(SceneOptions):
    """On what is tuned; see the help of each."""

    train_scenes: int = option(3, "Synthetic scenes to tune on.", least=1)
    held_out: int = option(10, "Further ones to compare on.", least=1)
    frames: int | None = option(
        None,
        "Of a folder: frames to tune on; by default half.  The start frame is included, and the "
        "comparison is on those after them.",
    )


@dataclasses.dataclass(frozen=True)
class Tuned:
    """What is tuned; see the help of each."""

    parameters: str | None = option(
        None,
        "Paths in the tracker, each perhaps with bounds: likelihood.sharpness=1:500.  By default "
        "how much the likelihood is trusted, and the noise of the position.",
    )
    objective: str = option(
        "evidence",
        "evidence (no labels), or from the truth: position, overlap, crps (spread judged, too).",
        choices=OBJECTIVES,
    )
    labels: int | None = option(
        None, "Labelled frames, evenly spread, for all but evidence; by default all."
    )


@dataclasses.dataclass(frozen=True)
class Descent:
    """How it is found; see the help of each."""

    gradient: str = option(
        "stop_gradient",
        "Through resampling: stop_gradient (unbiased), none (less noise), soft or transport.",
        choices=GRADIENTS,
    )
    steps: int = option(150, "At most, per repeat.")
    repeats: int = option(3, "Descents with seeds of their own.")
    learning_rate: float = option(0.1, "0.1: up to 10 % per step.")
    runs: int = option(2, "Runs per sequence and step.")
    seed: int = option(0, "Seed of everything random.")
    sequences_per_step: int = option(1, "Scenes per step.")
    random_numbers: str = option("fresh", "fresh at every step, or common to all.")
    clip: float = option(10.0, "Longest gradient.")
    window: int = option(20, "Steps that are averaged.")
    tolerance: float = option(
        0.02, "Stop when values change by less than this share from window to window."
    )


@dataclasses.dataclass(frozen=True)
class Outcome:
    """How it is judged, and where all goes; see the help of each."""

    compare_runs: int = option(20, "Runs of the comparison.", least=2)
    compare_particles: int = option(300, "Particles of the comparison.", least=1)
    output: Path | None = option(  # noqa: RUF009
        None,
        "Folder for the results, which a second call continues; jaxpf-tune-NAME by default.",
        flags=("-o",),
    )


@dataclasses.dataclass(frozen=True)
class Options(Outcome, Descent, Tuned, Scenes):
    """Options of ``jaxpf tune`` whatever is tuned."""

    def __post_init__(self) -> None:
        check_options(self)
        if self.labels is not None and self.objective == "evidence":
            raise InputError(
                f"labels = {self.labels} is of the other objectives, and evidence needs none; "
                "leave one of them out."
            )


def _command(**values: Any) -> None:
    from jaxpf.cli.tuning.output import (
        COMPARISON,
        TRACES,
        TUNED,
        compare_before_and_after,
        show,
        write_traces,
        write_tuned,
    )
    from jaxpf.cli.tuning.scenes import divided_scenes
    from jaxpf.files.writing import prepare_output_folder, report_os_errors
    from jaxpf.tuning.checkpoint import NAME

    options, source = picked(values, Options), resolved_scene(values["scene"])
    output = options.output or Path(f"jaxpf-tune-{scene_name(source)}")
    with report_os_errors("write into the output folder", output):
        continues = (output / NAME).is_file()
    train, unseen = divided_scenes(source, options)
    # A gradient goes back through all frames: they are in memory here and on the device.
    of_frames = 2 * sum(scene.frames.nbytes for scene in train)
    remedy = "ask for fewer particles (-n), --runs or --frames"
    check_memory(of_frames, remedy)
    start_jax()
    from jaxpf import tuning
    from jaxpf.tuning.declared import tuned_by_default
    from jaxpf.tuning.sequences import training_sequence

    its = {field.name for field in dataclasses.fields(tuning.Settings)} & options_of(options).keys()
    settings = tuning.Settings(**{name: getattr(options, name) for name in its})
    before, repeated = _recipe(values, options, train[0])
    if options.parameters is None:
        usual = tuned_by_default(chosen(before.of.options, before.values))
        options = dataclasses.replace(options, parameters=",".join(usual))
    wanted = [tuning.parameter(text) for text in names_in(options.parameters)]
    sequences = [
        training_sequence(scene, before, options.objective, options.labels) for scene in train
    ]
    _check_parameters(sequences[0].tracker, before.of, wanted)
    longest = max(len(sequence.frames) for sequence in sequences)
    check_memory(of_frames + needed_by(sequences[0].tracker, settings.runs, longest), remedy)
    if not continues:
        prepare_output_folder(output)
    try:
        result = _tune(sequences, wanted, settings, options.objective, output)
    except tuning.Diverged as error:
        write_tuned(output / TUNED, error.result, error.result.last_good, before)
        raise InputError(f"{error} They are kept in '{output / TUNED}'.") from None
    except KeyboardInterrupt:
        click.echo(
            f"The steps so far are kept in '{output}'; the same command continues.", err=True
        )
        raise
    repeated = {"scene": source, **as_typed(options), **repeated}
    write_config(output / "run.toml", "tune", repeated | {"output": None})
    write_tuned(output / TUNED, result, result.values, before)
    write_traces(output / TRACES, result, options.objective)
    show(result)
    compare_before_and_after(output, unseen, before, before.with_values(result.values), options)
    click.echo(f"{output}/: {TUNED}, {TRACES}, {COMPARISON}, run.toml")


command = SceneCommand(
    "tune",
    {
        "Scene": Scenes,
        "What is tuned": Tuned,
        "Descent": Descent,
        "Output": Outcome,
    },
    _command,
    rare=(
        "target",
        "scene_seed",
        "start_frame",
        "ids",
        "labels",
        "learning_rate",
        "seed",
        "sequences_per_step",
        "random_numbers",
        "clip",
        "window",
        "tolerance",
        "compare_particles",
    ),
    without=("order", "swap", "ess_threshold"),
    defaults={"particles": _PARTICLES},
    help="""Tune parameters on SCENE, and compare before and after on what was not seen.

    SCENE is as for `jaxpf evaluate`; `jaxpf tune SCENE --help` shows the options of what is in it.
    Synthetic scenes are tuned on some seeds and compared on others, a folder on its first frames
    and on the rest, starting there from the truth.

    The output folder receives tuned.toml (a --config for track and evaluate), tables, a figure and
    a checkpoint, from which the same command goes on.

    Example, in minutes: jaxpf tune distracter --sharpness 1 --scale 0.5,0.5,0.003 --learning-rate
    0.2 --window 15 --tolerance 0.1 --repeats 2 --steps 120
    """,
)


def _tune(
    sequences: list[Any], wanted: list[Any], settings: Any, objective: str, output: Path
) -> Any:
    """Tune behind a progress bar, or, where no terminal shows one, with a line now and then."""
    from jaxpf.tuning import loop

    shows_bars = sys.stderr.isatty()
    with progress_bar("steps") as bar:
        task = bar.add_task("compiling", total=settings.steps * settings.repeats)
        if not shows_bars:
            click.echo("Compiling: the first step follows in a minute or so.", err=True)

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

        return loop.tune(
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


def _recipe(values: Mapping[str, Any], options: Options, scene: Any) -> tuple[Any, dict[str, Any]]:
    """What the tracker is made of before tuning, and how it is typed again."""
    from jaxpf.tuning.sequences import Recipe

    target = adapter_of_scene(scene, options.target).target
    method = values["method"] or target.defaults.get("method")
    its = filters.filter_of(method) if method else next(iter(filters.all_filters().values()))
    own = {n: v for n, v in values.items() if n not in options_of(Options)}
    refuse_others(own, target, its)
    named = {
        text.partition("=")[0].partition("[")[0] for text in names_in(options.parameters or "")
    }
    for one in options_of(target.options).values():
        # Who names a parameter says of what kind the tracker is.
        if one.path in named and one.implies and own.get(one.implies[0]) in (None, OPEN):
            own[one.implies[0]] = one.implies[1]
    model = target.resolved(picked(own, target.options), is_filmed(scene))
    filter_options = picked(own, its.options, {"particles": _PARTICLES, **target.defaults})
    both = (filter_options, model)
    chosen_values = {name: getattr(one, name) for one in both for name in options_of(one)}
    typed = {n: v for one in both for n, v in as_typed(one).items() if n in values}
    return Recipe(target.name, chosen_values, gradient=options.gradient), typed
