"""``jaxpf tune``: tune parameters of the likelihood and the motion by gradient descent."""

import dataclasses
import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import click

from jaxpf.cli.shared.console import progress_bar, say
from jaxpf.cli.shared.flags import as_typed, parse, write_config
from jaxpf.cli.shared.scene_options import (
    SceneCommand,
    SceneOptions,
    names_in,
    refuse_others,
    resolved_scene,
    scene_name,
    scene_parameters,
)
from jaxpf.cli.shared.startup import start_jax
from jaxpf.cli.tuning import output as outputs
from jaxpf.contract.errors import InputError
from jaxpf.contract.options import OPEN, Option, options_of
from jaxpf.evaluation.scene import check_scene, load_scene
from jaxpf.files.store import Store, locked
from jaxpf.files.writing import check_output_folder, prepare_output_folder
from jaxpf.gradients import GRADIENTS
from jaxpf.targets.building import filter_for
from jaxpf.targets.registry import target_of_scene
from jaxpf.tuning.loop import Diverged, tune
from jaxpf.tuning.parameters import check_apart, parameter, read
from jaxpf.tuning.problem import OBJECTIVES
from jaxpf.tuning.result import Descent
from jaxpf.tuning.sequences import Recipe, training_sequence, tuned_by_default
from jaxpf.tuning.settings import Settings
from scenes import Scene

#: Default number of particles: a gradient costs more than a run.
_PARTICLES = 100
#: Defaults of the descent that differ from the library's: less work per step.
_DEFAULTS = {"runs": 2, "sequences_per_step": 1}


@dataclasses.dataclass(frozen=True)
class Scenes(SceneOptions):
    """Options that choose scenes."""

    target: Annotated[
        str | None, Option("Kind of target: boxes or parts; by default that of the truth.")
    ] = None
    train_scenes: Annotated[int, Option("Synthetic scenes to tune on.", least=1, most=1000)] = 3
    frames: Annotated[
        int | None,
        Option("Frames of a folder to tune on, the start frame included; by default half."),
    ] = None


@dataclasses.dataclass(frozen=True)
class Tuned:
    """Options that choose parameters and objective."""

    parameters: Annotated[
        str | None,
        Option(
            "Parameters by their paths in the tracker, with optional bounds: "
            "likelihood.sharpness=1:500.  By default the sharpness of the likelihood and the noise "
            "of the position."
        ),
    ] = None
    objective: Annotated[
        str,
        Option(
            "evidence (no labels), or against the truth: position, iou, crps (also judges the "
            "posterior standard deviation).",
            choices=OBJECTIVES,
        ),
    ] = "evidence"
    labels: Annotated[
        int | None,
        Option("Number of labelled frames, evenly spread; by default all.  Not for evidence."),
    ] = None
    gradient: Annotated[
        str,
        Option(
            "Gradient through resampling: stop_gradient (a bias of order 1/N), none (less noise, "
            "but a bias that more particles do not remove), soft or transport (both biased).",
            choices=tuple(GRADIENTS),
        ),
    ] = "stop_gradient"


@dataclasses.dataclass(frozen=True)
class Outcome:
    """Options of the output."""

    output: Annotated[
        Path | None,
        Option(
            "Folder for the results; the same command resumes from it.  [default: jaxpf-tune-NAME]",
            flags=("-o",),
        ),
    ] = None


@dataclasses.dataclass(frozen=True)
class Options(Outcome, Settings, Tuned, Scenes):
    """All of ``jaxpf tune``'s own options."""

    def __post_init__(self) -> None:
        # Not the check of the settings: values of flags are checked already.
        if self.labels is not None and self.objective == "evidence":
            raise InputError(
                f"--labels {self.labels} does not work with --objective evidence, which needs no "
                "labels; leave one of them out."
            )


def _command(**values: Any) -> None:
    options = Options(**parse(values, Options, defaults=_DEFAULTS))
    source = resolved_scene(values["scene"])
    folder = options.output or Path(f"jaxpf-tune-{scene_name(source)}")
    check_output_folder(folder)
    continues = Store(folder).settings() is not None
    scenes, unseen = _scenes_to_tune_on(source, options)
    start_jax()
    before, typed = _recipe(values, options, scenes[0])
    if options.parameters is None:
        by_default = tuned_by_default(before.of.tracker, before.values)
        options = dataclasses.replace(options, parameters=",".join(by_default))
    parameters = [parameter(text) for text in names_in(options.parameters or "")]
    settings = Settings(**{name: getattr(options, name) for name in options_of(Settings)})
    sequences = [
        training_sequence(scene, before, options.objective, options.labels) for scene in scenes
    ]
    check_apart(parameters)
    tunable = [each.path for each in options_of(before.of.tracker).values() if each.path]
    for each in parameters:
        read(sequences[0].tracker, each)
        if each.name not in tunable:
            raise InputError(
                f"the parameter {each.path} has no option in `jaxpf track` and `jaxpf evaluate`; "
                f"tune it in Python with jaxpf.tune, or choose among {', '.join(tunable)}."
            )
    prepare_output_folder(folder, overwrite=continues)
    click.get_current_context().with_resource(locked(folder, "tuning", keep=False))
    try:
        with progress_bar("steps") as bar:
            task = bar.add_task("compiling", total=settings.steps * settings.repeats)

            def progress(descent: Descent) -> None:
                done = settings.steps if descent.stopped else descent.num_steps
                bar.update(
                    task,
                    completed=descent.repeat * settings.steps + done,
                    description=f"repeat {descent.repeat + 1}, loss {descent.loss[-1]:.4g}",
                )

            result = tune(
                sequences,
                parameters,
                objective=options.objective,
                settings=settings,
                folder=folder,
                progress=progress,
            )
    except Diverged as error:
        tuned = folder / outputs.TUNED
        outputs.write_tuned(tuned, error.result, error.result.last_good, before)
        raise InputError(f"{error} They are kept in '{tuned}'.") from None
    except KeyboardInterrupt:
        say(f"The steps so far are kept in '{folder}'; the same command continues.", err=True)
        raise
    table = {"scene": source, **as_typed(vars(options), Options), **typed, "output": None}
    write_config(folder / "run.toml", "tune", table)
    outputs.write_tuned(folder / outputs.TUNED, result, result.values, before)
    outputs.write_traces(folder / outputs.TRACES, result, options.objective)
    outputs.show(result)
    say(f"{folder}/: {outputs.TUNED}, {outputs.TRACES}, run.toml")
    others = shlex.join([source, *unseen, "--config", str(folder / outputs.TUNED)])
    say(f"To compare on unseen frames, run this with and without --config: jaxpf evaluate {others}")


command = SceneCommand(
    "tune",
    {
        "Scene": Scenes,
        "What is tuned": Tuned,
        "Descent": Settings,
        "Output": Outcome,
    },
    _command,
    without=("order", "swap", "ess_threshold"),
    defaults={"num_particles": _PARTICLES, **_DEFAULTS},
    help="""Tune parameters on SCENE.

    SCENE is as for `jaxpf evaluate`.  A synthetic scene is tuned on some seeds, a folder on its
    first frames.  The last line says how to compare on unseen ones.

    The output folder receives tuned.toml (a --config for track and evaluate), a plot of the
    descent and a checkpoint, from which the same command resumes.

    Example, in minutes: jaxpf tune distracter --sharpness 1 --steps 120
    """,
)


def _scenes_to_tune_on(source: str, options: Options) -> tuple[list[Scene], list[str]]:
    """The scenes, and the flags of `jaxpf evaluate` for what they leave unseen.

    Synthetic scenes have consecutive seeds, and the next seed is unseen; of a folder, the first
    frames are taken, by default half.
    """
    first, *others = range(options.scene_seed, options.scene_seed + options.train_scenes)
    parameters = scene_parameters(options.set)
    scene = load_scene(source, first, options.ids, options.start_frame, None, parameters)
    check_scene(scene)
    if "source" in scene.extras:
        start, total = int(scene.extras["start_frame"]), len(scene.frames)
        count = total // 2 if options.frames is None else options.frames
        if not 2 <= count <= total - 2:
            raise InputError(
                f"--frames {count} must be 2 to {total - 2}: of the {total} frames of "
                f"{scene.name!r} some must be left for a comparison."
            )
        kept = dataclasses.replace(
            scene,
            frames=scene.frames[:count],
            boxes=scene.boxes[:count],
            name=f"{scene.name}, frames {start} to {start + count - 1}",
        )
        return [kept], ["--start-frame", str(start + count)]
    if options.frames is not None:
        raise InputError(
            f"--frames {options.frames} divides a folder's frames, but {source!r} is drawn by a "
            "function; leave it out."
        )
    drawn = {first: scene}
    for seed in others:
        drawn[seed] = load_scene(source, seed, parameters=parameters)
        check_scene(drawn[seed])
    scenes = [
        dataclasses.replace(each, name=f"{each.name}, seed {seed}") for seed, each in drawn.items()
    ]
    typed = [word for text in options.set for word in ("--set", text)]
    return scenes, ["--scene-seed", str(first + len(scenes)), *typed]


def _recipe(
    values: Mapping[str, Any], options: Options, scene: Scene
) -> tuple[Recipe, dict[str, Any]]:
    """The recipe of the tracker before tuning, and its options in command-line notation."""
    target = target_of_scene(scene, options.target)
    filter_ = filter_for(target, values["method"])
    own = {n: v for n, v in values.items() if n not in options_of(Options)}
    refuse_others(own, target, filter_)
    parameters = names_in(options.parameters or "")
    named = {text.partition("=")[0].partition("[")[0] for text in parameters}
    for declared in options_of(target.tracker).values():
        # A named parameter may imply the kind of tracker.
        if declared.path in named and declared.needs:
            name, value, *_ = declared.needs
            if own.get(name) in (None, OPEN):
                own[name] = value
    defaults = {"num_particles": _PARTICLES, **target.defaults}
    chosen = parse(own, filter_.build, target.tracker, defaults=defaults)
    chosen = target.settle(chosen, scene.settings, scene.num_objects)
    typed = as_typed(chosen, filter_.build, target.tracker)
    typed = {name: value for name, value in typed.items() if name in values}
    return Recipe(target.name, chosen, gradient=options.gradient), typed
