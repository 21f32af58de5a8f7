"""Options of kinds of target and of filters, and those of the scenes of evaluate and tune."""

import dataclasses
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import click

import scenes
from jaxpf.cli.shared.flags import Command, config_flag, declared_flags, given_in, pair
from jaxpf.contract.errors import InputError
from jaxpf.contract.options import Option, options_of
from jaxpf.filters.registry import Filter, all_filters
from jaxpf.targets.registry import DEFAULT, all_targets
from jaxpf.targets.target import Target


def filter_options(unsuited: Sequence[str] = ()) -> dict[str, Option]:
    """The options of all filters but those whose methods are ``unsuited``."""
    families = [each for each in all_filters().values() if {*each.methods} - {*unsuited}]
    declared = options_of(*(each.build for each in families))
    about = [options_of(each.build)["method"].help.removesuffix(".") for each in families]
    method = dataclasses.replace(declared["method"], help=f"Sampling: {', '.join(about)}.")
    return {**declared, "method": method}


def refuse_others(values: Mapping[str, Any], target: Target, filter_: Filter) -> None:
    """Refuse flags of another kind of target or another filter than those of this run."""
    owners: dict[str, dict[str, Option]] = {}
    for each in all_filters().values():
        declared = options_of(each.build).items()
        for method in each.methods:
            fitting = {n: option for n, option in declared if option.applies({"method": method})}
            owners[f"--method {method}"] = fitting
    owners |= {name: options_of(each.tracker) for name, each in all_targets().items()}
    for name in given_in(values).keys() - options_of(target.tracker, filter_.build).keys():
        if having := [owner for owner, options in owners.items() if name in options]:
            raise InputError(
                f"{owners[having[0]][name].flag} works only with {' or '.join(having)}, and this "
                f"run tracks {target.name} by the {filter_.name} filter; leave it out."
            )


@dataclasses.dataclass(frozen=True)
class SceneOptions:
    """The scene and the part of it to use."""

    target: Annotated[
        str | None,
        Option(f"Kind of target: {', '.join(all_targets())}; by default that of the truth."),
    ] = None
    set: Annotated[
        tuple[str, ...],
        Option("A synthetic scene's parameter, NAME=VALUE; repeat it.  Such as lead_distance=60."),
    ] = ()
    scene_seed: Annotated[int, Option("Seed of a synthetic scene, or of the first one.")] = 0
    ids: Annotated[
        tuple[int, ...] | None,
        Option("Objects of a folder's truth, such as 1,2,5; by default all in the start frame."),
    ] = None
    frames: Annotated[
        int | None, Option("Frames of a folder to use, the start frame included.")
    ] = None
    start_frame: Annotated[
        int | None,
        Option("Start frame of a folder, from 0; by default the first with all objects."),
    ] = None


class SceneCommand(Command):
    """A command on a scene, with options of all kinds of target and of all filters.

    The target is known only once the scene is open; then options of other targets are refused.
    """

    def __init__(
        self,
        name: str,
        options: Mapping[str, type],
        callback: Callable[..., None],
        *,
        grid: bool = False,
        without: Sequence[str] = (),
        defaults: Mapping[str, Any] | None = None,
        **settings: Any,
    ):
        """Make the command.

        Args:
            name: name of the command.
            options: help section -> class of the command's own options.
            callback: function of all values by name.
            grid: see ``declared_flags``.
            without: names of filter options to omit.
            defaults: defaults that differ from the declared ones.
            settings: see ``Command``.
        """
        params: list[click.Parameter] = [click.Argument(["scene"])]
        for section, owner in options.items():
            params += declared_flags(options_of(owner), section, defaults=defaults)
        of_filters = {n: each for n, each in filter_options().items() if n not in without}
        every = sorted(all_targets().values(), key=lambda target: target.name != DEFAULT)
        of = {target.name: options_of(target.tracker) for target in every}
        of_targets = options_of(*(target.tracker for target in every))
        for each, option in of_targets.items():
            kinds = ", ".join(name for name in of if each in of[name])
            of_targets[each] = dataclasses.replace(option, help=f"{option.help}  ({kinds})")
        for section, some in (("Model", of_targets), ("Filter", of_filters)):
            params += declared_flags(some, section, defaults=defaults, grid=grid)
        where = "jaxpf.boxes.tracker and the other factories"
        params.append(config_flag())
        super().__init__(name, params=params, callback=callback, where=where, **settings)


def resolved_scene(source: str) -> str:
    """A scene with an absolute path, so that run.toml works from anywhere."""
    if not source:
        raise InputError("SCENE is empty; give a scene's name or a folder, or . for this folder.")
    place, colon, function = source.rpartition(":")
    if colon and Path(place).is_file():
        return f"{Path(place).resolve()}:{function}"
    path = Path(source)
    is_folder = path.exists() and (source != path.name or source not in scenes.names())
    return str(path.resolve()) if is_folder else source


def scene_name(source: str) -> str:
    """Name of a scene for its output folder."""
    return Path(source.rpartition(":")[2] or source).name


def names_in(text: str) -> list[str]:
    """Split comma-separated names."""
    return [name.strip() for name in text.split(",") if name.strip()]


def scene_parameters(texts: Sequence[str]) -> dict[str, Any]:
    """Parse the parameters of ``--set``; a value is a number, true, false, none, or text."""
    return dict(pair("--set", text, _value) for text in texts)


def _value(text: str) -> Any:
    if text.lower() in ("none", "null"):
        return None
    try:
        return json.loads(text.lower() if text.lower() in ("true", "false") else text)
    except ValueError:
        return text
