"""``jaxpf tune``: tune parameters of the likelihood and the motion by gradient descent."""

import dataclasses
import shlex
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import click

from jaxpf import filters
from jaxpf.cli.shared.config import write_config
from jaxpf.cli.shared.console import progress_bar
from jaxpf.cli.shared.flags import as_typed, picked, refuse_others, report_implied
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
from jaxpf.contract.options import OPEN, chosen, option, options_of
from jaxpf.running.memory import check_memory, needed_by
from jaxpf.targets import adapter_of_scene
from jaxpf.targets.adapter import is_filmed
from jaxpf.tuning.settings import Settings

#: Default number of particles: a gradient costs more than a run.
_PARTICLES = 100
#: Defaults of the descent that differ from the library's: less work per step.
_DEFAULTS = {"runs": 2, "sequences_per_step": 1}
_LESS_MEMORY = "ask for fewer particles (-n), --runs or --frames"
#: Steps per progress line if there is no terminal.
_STEPS_PER_LINE = 10


@dataclasses.dataclass(frozen=True)
class Scenes(SceneOptions):
    """Options that choose scenes."""

    train_scenes: int = option(3, "Synthetic scenes to tune on.", least=1, most=1000)
    frames: int | None = option(
        None,
        "Frames of a folder to tune on, the start frame included; by default half.",
    )


@dataclasses.dataclass(frozen=True)
class Tuned:
    """Options that choose parameters and objective."""

    parameters: str | None = option(
        None,
        "Parameters by their paths in the tracker, with optional bounds: "
        "likelihood.sharpness=1:500.  By default the sharpness of the likelihood and the noise of "
        "the position.",
    )
    objective: str = option(
        "evidence",
        "evidence (no labels), or against the truth: position, overlap, crps (also judges the "
        "spread).",
        choices=OBJECTIVES,
    )
    labels: int | None = option(
        None,
        "Number of labelled frames, evenly spread; by default all.  Not for evidence.",
    )
    gradient: str = option(
        "stop_gradient",
        "Through resampling: stop_gradient (unbiased), none (less noise), soft or transport.",
        choices=GRADIENTS,
    )


@dataclasses.dataclass(frozen=True)
class Outcome:
    """Options of the output."""

    output: Path | None = option(  # noqa: RUF009
        None,
        "Folder for the results; the same command resumes from it.  [default: jaxpf-tune-NAME]",
        flags=("-o",),
    )


@dataclasses.dataclass(frozen=True)
class Options(Outcome, Settings, Tuned, Scenes):
    """All of ``jaxpf tune``'s own options."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.labels is not None and self.objective == "evidence":
            raise InputError(
                f"--labels {self.labels} does not work with --objective evidence, which needs no "
                "labels; leave one of them out."
            )


class _Request(NamedTuple):
    """The command line: options, the absolute scene, and the values of all flags."""

    options: Options
    source: str
    values: Mapping[str, Any]

    @property
    def output(self) -> Path:
        """The folder for the results."""
        return self.options.output or Path(f"jaxpf-tune-{scene_name(self.source)}")


class _Opened(NamedTuple):
    """The scenes, and whether the folder holds a checkpoint."""

    scenes: list[Any]
    continues: bool

    @property
    def bytes(self) -> int:
        """Bytes of all frames: a gradient needs them both in memory and on the device."""
        return 2 * sum(scene.frames.nbytes for scene in self.scenes)


class _Settled(NamedTuple):
    """The recipe before tuning, fully resolved options, and the contents of run.toml."""

    before: Any
    options: Options
    table: dict[str, Any]


class _Built(NamedTuple):
    """Training sequences, parameters, and settings of the descents."""

    sequences: list[Any]
    parameters: list[Any]
    settings: Any


def _command(**values: Any) -> None:
    request = _Request(picked(values, Options, _DEFAULTS), resolved_scene(values["scene"]), values)
    opened = _open(request)
    start_jax()
    settled = _settle(request, opened)
    built = _build(opened, settled)
    result = _run(request, opened, settled, built)
    _finish(request, opened, settled, result)


def _open(request: _Request) -> _Opened:
    """Load the scenes.

    Raises:
        InputError: the scenes cannot be loaded or cut, or do not fit in memory.
    """
    from jaxpf.cli.tuning.scenes import scenes_to_tune_on
    from jaxpf.files.writing import report_os_errors
    from jaxpf.tuning.checkpoint import NAME

    with report_os_errors("write into the output folder", request.output):
        continues = (request.output / NAME).is_file()
    opened = _Opened(scenes_to_tune_on(request.source, request.options), continues)
    check_memory(opened.bytes, _LESS_MEMORY)
    return opened


def _settle(request: _Request, opened: _Opened) -> _Settled:
    """Choose the filter, the model and the default parameters."""
    from jaxpf.tuning.declared import tuned_by_default

    options = request.options
    before, repeated = _recipe(request.values, options, opened.scenes[0])
    if options.parameters is None:
        usual = tuned_by_default(chosen(before.of.options, before.values))
        options = dataclasses.replace(options, parameters=",".join(usual))
    table = {"scene": request.source, **as_typed(options), **repeated, "output": None}
    return _Settled(before, options, table)


def _build(opened: _Opened, settled: _Settled) -> _Built:
    """Build the trackers; check that they have the parameters and fit in memory."""
    from jaxpf import tuning
    from jaxpf.tuning.sequences import training_sequence

    options, before = settled.options, settled.before
    settings = chosen(Settings, vars(options))
    parameters = [tuning.parameter(text) for text in names_in(options.parameters or "")]
    sequences = [
        training_sequence(scene, before, options.objective, options.labels)
        for scene in opened.scenes
    ]
    tracker = sequences[0].tracker
    _check_parameters(tracker, before.of, parameters)
    longest = max(len(sequence.frames) for sequence in sequences)
    check_memory(opened.bytes + needed_by(tracker, settings.runs, longest), _LESS_MEMORY)
    return _Built(sequences, parameters, settings)


def _run(request: _Request, opened: _Opened, settled: _Settled, built: _Built) -> Any:
    """Tune; an interruption leaves a checkpoint, divergence the last finite values."""
    from jaxpf import tuning
    from jaxpf.cli.tuning.output import TUNED, write_tuned
    from jaxpf.files.writing import prepare_output_folder

    output = request.output
    if not opened.continues:
        prepare_output_folder(output)
    try:
        return _tune(
            built.sequences, built.parameters, built.settings, settled.options.objective, output
        )
    except tuning.Diverged as error:
        write_tuned(output / TUNED, error.result, error.result.last_good, settled.before)
        raise InputError(f"{error} They are kept in '{output / TUNED}'.") from None
    except KeyboardInterrupt:
        click.echo(
            f"The steps so far are kept in '{output}'; the same command continues.", err=True
        )
        raise


def _finish(request: _Request, opened: _Opened, settled: _Settled, result: Any) -> None:
    """Write the results, and name unseen frames to compare on."""
    from jaxpf.cli.tuning import output as outputs
    from jaxpf.cli.tuning.scenes import unseen

    folder, before = request.output, settled.before
    write_config(folder / "run.toml", "tune", settled.table)
    outputs.write_tuned(folder / outputs.TUNED, result, result.values, before)
    outputs.write_traces(folder / outputs.TRACES, result, settled.options.objective)
    outputs.show(result)
    click.echo(f"{folder}/: {outputs.TUNED}, {outputs.TRACES}, run.toml")
    others = shlex.join([request.source, *unseen(opened.scenes, settled.options)])
    config = shlex.quote(str(folder / outputs.TUNED))
    click.echo(
        "To compare on unseen frames, run this with and without --config: jaxpf evaluate "
        f"{others} --config {config}"
    )


command = SceneCommand(
    "tune",
    {
        "Scene": Scenes,
        "What is tuned": Tuned,
        "Descent": Settings,
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
        "clip",
        "window",
        "tolerance",
        "jitter",
    ),
    without=("order", "swap", "ess_threshold"),
    defaults={"particles": _PARTICLES, **_DEFAULTS},
    help="""Tune parameters on SCENE.

    SCENE is as for `jaxpf evaluate`.  A synthetic scene is tuned on some seeds, a folder on its
    first frames.  The last line says how to compare on unseen ones.

    The output folder receives tuned.toml (a --config for track and evaluate), a plot of the
    descent and a checkpoint, from which the same command resumes.

    Example, in minutes: jaxpf tune distracter --sharpness 1 --steps 120
    """,
)


def _tune(
    sequences: list[Any], wanted: list[Any], settings: Any, objective: str, output: Path
) -> Any:
    """Tune with a progress bar, or with occasional lines if there is no terminal."""
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
    """Refuse parameters without an option of `jaxpf track` and `jaxpf evaluate`."""
    from jaxpf import tuning
    from jaxpf.tuning.parameters import check_apart

    if not wanted:
        raise InputError(
            "--parameters names none; name at least one, such as likelihood.sharpness."
        )
    check_apart(wanted)
    tunable = [option.path for option in options_of(target.options).values() if option.path]
    for parameter in wanted:
        tuning.read(tracker, parameter)
        if parameter.name not in tunable:
            raise InputError(
                f"the parameter {parameter.path} has no option in `jaxpf track` and `jaxpf "
                f"evaluate`; tune it in Python with jaxpf.tune, or choose among "
                f"{', '.join(tunable)}."
            )


def _recipe(values: Mapping[str, Any], options: Options, scene: Any) -> tuple[Any, dict[str, Any]]:
    """The recipe of the tracker before tuning, and its options in command-line notation."""
    from jaxpf.tuning.sequences import Recipe

    target = adapter_of_scene(scene, options.target).target
    method = values["method"] or target.defaults.get("method")
    filter_ = filters.filter_of(method) if method else next(iter(filters.all_filters().values()))
    own = {n: v for n, v in values.items() if n not in options_of(Options)}
    refuse_others(own, target, filter_)
    report_implied(own, target.resolved(target.options(), is_filmed(scene)))
    named = {
        text.partition("=")[0].partition("[")[0] for text in names_in(options.parameters or "")
    }
    for declared in options_of(target.options).values():
        # A named parameter may imply the kind of tracker.
        if declared.path in named and declared.implies:
            name, value = declared.implies
            if own.get(name) in (None, OPEN):
                own[name] = value
    model = target.resolved(picked(own, target.options), is_filmed(scene), scene.num_objects)
    filter_options = picked(own, filter_.options, {"particles": _PARTICLES, **target.defaults})
    both = (filter_options, model)
    chosen_values = {name: getattr(owner, name) for owner in both for name in options_of(owner)}
    typed = {n: v for owner in both for n, v in as_typed(owner).items() if n in values}
    return Recipe(target.name, chosen_values, gradient=options.gradient), typed
