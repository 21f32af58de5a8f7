"""Options shared by `jaxpf evaluate` and `jaxpf tune`: a scene, and options of its target."""

import contextlib
import dataclasses
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import click

from jaxpf import filters
from jaxpf.cli.shared.config import config_flag
from jaxpf.cli.shared.flags import ALL, Command, Flag, declared_flags, filter_flags
from jaxpf.contract.errors import InputError
from jaxpf.contract.options import Option, options_of
from jaxpf.targets import all_targets, find_target, target_of_scene

_TARGET, _METHODS = "jaxpf.cli.target", "jaxpf.cli.methods"


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


def _particles() -> str:
    """The default number of particles, with the targets that have another."""
    defaults = {name: target.defaults for name, target in all_targets().items()}
    others = [
        f"{name} {own['num_particles']}" for name, own in defaults.items() if "num_particles" in own
    ]
    usual = options_of(filters.filter_of("dps").build)["num_particles"].default
    return f"{usual}; {', '.join(others)}"


class SceneCommand(Command):
    """A command on a scene, with options of the scene's target and of the methods.

    The target is known only once the scene is open.  Options of all targets are parsed first and
    those of other targets refused later; ``COMMAND SCENE --help`` explains this target's options.
    """

    def __init__(
        self,
        name: str,
        options: Mapping[str, type],
        callback: Callable[..., None],
        *,
        rare: Sequence[str],
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
            rare: see ``declared_flags``.
            grid: see ``declared_flags``.
            without: names of filter options to omit.
            defaults: defaults that differ from the declared ones.
            settings: see ``Command``.
        """
        own = [
            flag
            for section, owner in options.items()
            for flag in declared_flags(options_of(owner), section, defaults=defaults, rare=rare)
        ]
        params = [click.Argument(["scene"]), *own, config_flag(own[-1].section)]
        super().__init__(name, params=params, callback=callback, **settings)
        self._own, self._about = list(self.params), (grid, tuple(without), defaults or {})
        flags = [flag for name in all_targets() for flag in self._of_target(name)]
        by_name = {flag.name: flag for flag in reversed([*flags, *self._of_filters({})])}
        self.params = [*self.params, *reversed(by_name.values())]

    def _of_target(self, name: str) -> list[Flag]:
        grid, _, defaults = self._about
        declared = options_of(find_target(name).tracker)
        return declared_flags(declared, f"For {name}", defaults=defaults, grid=grid)

    def _of_filters(self, of_target: Mapping[str, Any], methods: Sequence[str] = ()) -> list[Flag]:
        grid, without, defaults = self._about
        defaults = {**of_target, **defaults}
        return filter_flags(defaults, grid=grid, without=without, methods=methods)

    def shown(self, ctx: click.Context) -> list[click.Parameter]:
        """Show the options of the scene's target and of the named methods; without a scene,
        ``--help-all`` shows those of all targets.
        """
        named, methods = ctx.meta.get(_TARGET), ctx.meta.get(_METHODS, ())
        names = [named] if named else all_targets()
        of = [flag for name in names for flag in self._of_target(name)]
        for flag in of:
            flag.common = bool(named)
        of_target = find_target(named).defaults if named else {"num_particles": _particles()}
        of_filters = self._of_filters(of_target, methods)
        own = [*self._own, *self.get_params(ctx)[-1:], *of_filters]
        return [*own, *of] if named or ctx.meta.get(ALL) else own

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse as click does; help refers to the scene, if one is given."""
        wanted = {"-h", "--help", "--help-all"} & set(args)
        if wanted and not ctx.resilient_parsing:
            others = [text for text in args if text not in wanted]
            with contextlib.suppress(InputError):
                asked = self.make_context(self.name, others, ctx.parent, resilient_parsing=True)
                ctx.meta[_METHODS] = _methods_of(asked.params)
                ctx.meta[_TARGET] = _target_of(asked.params)
        return super().parse_args(ctx, args)


def _target_of(values: Mapping[str, Any]) -> str | None:
    """The target of the scene, or None without a scene."""
    from jaxpf.evaluation.scene import load_scene

    if values["target"] or not values["scene"]:
        return values["target"]
    return target_of_scene(load_scene(values["scene"])).name


def _methods_of(values: Mapping[str, Any]) -> list[str]:
    """The methods given to ``evaluate`` or ``tune``; an empty list means all."""
    named = names_in(values.get("methods") or values.get("method") or "")
    for method in named:
        filters.filter_of(method)
    return named


def resolved_scene(source: str) -> str:
    """A scene with an absolute path, so that run.toml works from anywhere."""
    import scenes

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


def pair(option: str, text: str, convert: Callable[[str], Any]) -> tuple[str, Any]:
    """Parse ``NAME=VALUE``."""
    name, equals, value = text.partition("=")
    if not (equals and name.strip() and value.strip()):
        raise InputError(f"{option} {text!r} must have the form NAME=VALUE.")
    return name.strip(), convert(value.strip())


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
