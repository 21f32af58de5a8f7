"""Flags of declared options (``jaxpf.contract.options``); rare ones by ``--set NAME=VALUE``."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import click

from jaxpf.cli.shared.plain import GivenPath, NumberList, PlainCommand
from jaxpf.contract.errors import InputError
from jaxpf.contract.numbers import plain
from jaxpf.contract.options import OPEN, Option, applying, complete, options_of
from jaxpf.filters import Filter
from jaxpf.filters.registry import all_filters
from jaxpf.targets import Target
from jaxpf.targets.registry import all_targets

_SET = "A further option, NAME=VALUE; repeat it.  They are {names}, explained in {where}."


class Flag(click.Option):
    """An option with its section in the help; a rare one has no flag, see ``Command``."""

    def __init__(self, *spellings: Any, section: str = "Options", rare: bool = False, **about: Any):
        super().__init__(*spellings, **about)
        self.section, self.rare = section, rare

    def get_error_hint(self, ctx: click.Context | None) -> str:
        """How messages show it."""
        return f"'--set {self.name}'" if self.rare else super().get_error_hint(ctx)


class Command(PlainCommand):
    """A command with help in sections, and rare options by ``--set``."""

    def __init__(self, *arguments: Any, where: str = "", **settings: Any):
        """Make the command; ``where`` the rare options are explained, the rest as by click."""
        super().__init__(*arguments, **settings)
        rare = [each for each in self.params if isinstance(each, Flag) and each.rare]
        self.rare = {str(each.name): each for each in rare}
        self.params = [each for each in self.params if each.name not in self.rare]
        about = _SET.format(names=", ".join(sorted(self.rare)), where=where)
        own = [each for each in self.params if each.name == "set"]
        self.takes_others = bool(own)
        if own and isinstance(own[0], click.Option):
            own[0].help = f"{own[0].help}  {about}"
        elif self.rare:
            section = getattr(self.params[-1], "section", "Options")
            extra = Flag(
                ["--set"], section=section, multiple=True, metavar="NAME=VALUE", help=about
            )
            self.params.append(extra)

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse as click does; then move rare options from ``--set`` to values of their own."""
        try:
            rest = super().parse_args(ctx, args)
        except click.NoSuchOption as error:
            name = error.option_name.removeprefix("--").replace("-", "_")
            if name not in self.rare:
                raise
            how = f"No such option {error.option_name}; write --set {name}=VALUE"
            raise click.NoSuchOption(error.option_name, how, ctx=ctx) from None
        given: dict[str, list[str]] = {}
        others = []
        for text in ctx.params.pop("set", None) or ():
            name, value = pair("--set", text, str)
            if (plain_name := name.replace("-", "_")) in self.rare:
                given.setdefault(plain_name, []).append(value)
            elif self.takes_others:
                others.append(text)
            else:
                known = ", ".join(sorted(self.rare))
                raise InputError(f"--set {name} is not an option; there are {known}.")
        if self.takes_others:
            ctx.params["set"] = tuple(others)
        written = ctx.default_map or {}
        for name, flag in self.rare.items():
            raw: Any = written.get(name)
            source = click.core.ParameterSource.DEFAULT_MAP
            if name in given:
                raw = given[name] if flag.multiple else given[name][-1]
                source = click.core.ParameterSource.COMMANDLINE
            ctx.params[name] = None if raw is None else flag.type_cast_value(ctx, raw)
            ctx.set_parameter_source(name, source)
        return rest

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the options, a section after the other."""
        sections: dict[str, list[tuple[str, str]]] = {}
        title = "Options"
        for param in self.get_params(ctx):
            title = getattr(param, "section", title)
            if isinstance(param, click.Option) and (record := param.get_help_record(ctx)):
                sections.setdefault(title, []).append(record)
        for title, records in sections.items():
            with formatter.section(title):
                formatter.write_dl(records, col_max=28)


def pair(option: str, text: str, convert: Callable[[str], Any]) -> tuple[str, Any]:
    """Parse ``NAME=VALUE``."""
    name, equals, value = text.partition("=")
    if not (equals and name.strip() and value.strip()):
        raise InputError(f"{option} {text!r} must have the form NAME=VALUE.")
    return name.strip(), convert(value.strip())


def declared_flags(
    declared: Mapping[str, Option],
    section: str,
    *,
    defaults: Mapping[str, Any] | None = None,
    grid: bool = False,
) -> list[Flag]:
    """Make the flags of declared options.

    Args:
        declared: name -> option, see ``jaxpf.contract.options.options_of``.
        section: help section.
        defaults: defaults that differ from the declared ones.
        grid: whether each flag takes several comma-separated values; an option of several numbers
            is repeated instead.
    """
    flags = []
    for option in declared.values():
        default = (defaults or {}).get(option.name, option.default)
        about: dict[str, Any] = {"section": section, "rare": option.rare}
        about["help"] = _help(option, default)
        spelling = f"--{option.name.replace('_', '-')}"
        if option.kind is bool:
            about |= {"is_flag": True, "default": None}
            if option.default:
                spelling = f"{spelling}/--no-{spelling.removeprefix('--')}"
        else:
            about["type"], about["multiple"] = _click_type(option, grid)
        flags.append(Flag([spelling, *option.flags, option.name], **about))
    return flags


def _help(option: Option, default: object) -> str:
    """What the option does, its choices and its default."""
    text = option.help
    if option.name != "method" and not all(choice in text for choice in option.choices):
        effect, *more = text.split(".  ", 1)
        text = ".  ".join([f"{effect.removesuffix('.')}: {_either(option.choices)}.", *more])
    if default is None or default is False or default == () or "default" in text:
        return text
    return f"{text}  [default: {'on' if default is True else plain(default)}]"


def _either(names: Sequence[str]) -> str:
    """As "a, b or c"."""
    *others, last = names
    return f"{', '.join(others)} or {last}" if others else last


def _click_type(option: Option, grid: bool) -> tuple[Any, bool]:
    if option.kind is Path:
        return GivenPath(), False
    if option.kind is str and option.length:
        return str, True
    if option.length:
        counted = option.length > 0 and not option.per_object
        return NumberList(option.kind, option.length if counted else None), grid
    if not grid:
        return option.kind, False
    return (str if option.kind is str else NumberList(option.kind)), False


def filter_options(unsuited: Sequence[str] = ()) -> dict[str, Option]:
    """The options of all filters but those whose methods are ``unsuited``."""
    families = [each for each in all_filters().values() if {*each.methods} - {*unsuited}]
    declared = options_of(*(each.build for each in families))
    about = [options_of(each.build)["method"].help.removesuffix(".") for each in families]
    method = dataclasses.replace(declared["method"], help=f"Sampling: {', '.join(about)}.")
    return {**declared, "method": method}


def start_flags(flags: Mapping[str, Mapping[str, Any]], section: str) -> list[Flag]:
    """Make the flags that define where a target starts."""
    options = []
    for name, about in flags.items():
        kind = about.get("type", str)
        if isinstance(kind, list):
            given: Any = NumberList(kind[0])
        else:
            given = GivenPath() if kind is Path else kind
        spelling = f"--{name.replace('_', '-')}"
        options.append(Flag([spelling], section=section, **{**about, "type": given}))
    return options


def given_in(values: Mapping[str, Any]) -> dict[str, Any]:
    """Select the values of flags that were given."""
    return {name: value for name, value in values.items() if value not in (None, ())}


def as_typed(owner: Callable[..., Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """An owner's applicable options in command-line notation, by name; None for the rest."""
    applicable, typed = applying(owner, values), {}
    for name, option in options_of(owner).items():
        value = applicable.get(name)
        if option.places and value and value != OPEN:
            value = [place + 1 for place in value]
        typed[name] = value
    return typed


def picked(
    owner: Callable[..., Any], values: Mapping[str, Any], defaults: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """The checked values of an owner's options from flags; missing ones have their defaults."""
    given = {}
    for name, each in options_of(owner).items():
        if values.get(name) == "":  # as an unset variable of the shell is
            raise InputError(f"{each.flag} is empty; give a value, or leave it out.")
        if values.get(name) not in (None, ()):
            given[name] = _from_people(each, values[name])
    return complete(owner, given, defaults)


def _from_people(option: Option, value: Any) -> Any:
    """Convert indices from 1-based to 0-based."""
    if not option.places or value == OPEN:
        return value
    if any(place < 1 for place in value):
        raise InputError(f"{option.flag} {plain(value)} is too small; it counts from 1.")
    return tuple(place - 1 for place in value)


def refuse_others(values: Mapping[str, Any], target: Target, filter_: Filter) -> None:
    """Refuse flags of another kind of target or another filter than those of this run."""
    own = options_of(target.tracker, filter_.build)
    owners: dict[str, dict[str, Option]] = {}
    for each in all_filters().values():
        for method in each.methods:
            declared = options_of(each.build).items()
            fitting = {n: option for n, option in declared if option.applies({"method": method})}
            owners[f"--method {method}"] = fitting
    owners |= {name: options_of(each.tracker) for name, each in all_targets().items()}
    for name in given_in(values).keys() - own.keys():
        if having := [owner for owner, options in owners.items() if name in options]:
            raise InputError(
                f"{owners[having[0]][name].flag} works only with {' or '.join(having)}, and this "
                f"run tracks {target.name} by the {filter_.name} filter; leave it out."
            )
