"""Flags of declared options, and help that fits on a screen.

Option classes (``jaxpf.contract.options``) fully describe each option; one loop makes its flag.
Help explains the common options by section and lists only the names of the rest, which
``--help-all`` explains.
"""

import dataclasses
import inspect
import textwrap
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from jaxpf import filters
from jaxpf.cli.shared.console import say
from jaxpf.cli.shared.plain import GivenPath, NumberList, PlainCommand
from jaxpf.contract.errors import InputError
from jaxpf.contract.numbers import plain
from jaxpf.contract.options import OPEN, Option, applying, complete, options_of
from jaxpf.targets import all_targets

if TYPE_CHECKING:
    from jaxpf.filters.registry import Filter
    from jaxpf.targets.target import Target


class Flag(click.Option):
    """An option with its place in the help.

    Attributes:
        section: help section.
        common: whether ``--help`` explains it or only lists its name.
        is_named: whether ``--help`` lists it at all.
    """

    def __init__(
        self, *spellings: Any, section: str = "Options", common: bool = True, **about: Any
    ):
        super().__init__(*spellings, **about)
        self.section, self.common, self.is_named = section, common, True

    def get_help_record(self, ctx: click.Context) -> tuple[str, str] | None:
        """Spellings and help: first sentence and default only, unless ``--help-all`` is given."""
        record = super().get_help_record(ctx)
        if record is None or ctx.meta.get(ALL):
            return record
        first, *_, last = record[1].split(".  ") * 2
        default = f".  {last}" if last != first and last.startswith("[default") else ""
        return record[0], first.removesuffix(".") + (default or ".")


class Command(PlainCommand):
    """A command with help in sections, see ``Flag``.

    ``--help`` explains each common option in a sentence and lists the names of the rest;
    ``--help-all`` explains every option.
    """

    def __init__(self, *arguments: Any, more: str = "", **settings: Any):
        """Make the command.

        Args:
            arguments: see ``click.Command``.
            more: text shown by ``--help-all`` only.
            settings: see ``click.Command``.
        """
        super().__init__(*arguments, **settings)
        self.more = inspect.cleandoc(more)
        self.params.append(_help_all())

    def shown(self, ctx: click.Context) -> list[click.Parameter]:
        """The parameters to show in the help, in order."""
        return self.get_params(ctx)

    def format_help_text(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the description of the command."""
        super().format_help_text(ctx, formatter)
        if ctx.meta.get(ALL) and self.more:
            formatter.write_paragraph()
            with formatter.indentation():
                formatter.write_text(self.more)

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the sections, then the names of the omitted options."""
        explained: dict[str, list[tuple[str, str]]] = {}
        left_out: dict[str, list[str]] = {}
        unnamed: list[str] = []
        title = "Options"
        for param in self.shown(ctx):
            if not isinstance(param, click.Option) or param.hidden:
                continue
            title = getattr(param, "section", title)
            if not ctx.meta.get(ALL) and not getattr(param, "common", True):
                if getattr(param, "is_named", True):
                    left_out.setdefault(title, []).append(param.opts[0])
                elif title not in unnamed:
                    unnamed.append(title)
            elif record := param.get_help_record(ctx):
                explained.setdefault(title, []).append(record)
        for title, records in explained.items():
            with formatter.section(title):
                formatter.write_dl(records, col_max=28)
        if left_out:
            rows: list[tuple[str, str]] = []
            for title, names in left_out.items():
                width = formatter.width - 2 - max(map(len, left_out)) - 2
                lines = textwrap.wrap(" ".join(names), width, break_on_hyphens=False)
                rows += zip([title, *[""] * len(lines)], lines, strict=False)
            if unnamed:
                families = ", ".join(title.removeprefix(_FOR) for title in unnamed)
                rows.append(("Other families", f"options of {families}"))
            with formatter.section("More, explained by --help-all"):
                formatter.write_dl(rows)


ALL = "jaxpf.cli.help_all"
#: How the title of a section for some methods or a kind of target begins.
_FOR = "For "


def _help_all() -> click.Option:
    def show(ctx: click.Context, param: click.Parameter, wanted: bool) -> None:
        if wanted and not ctx.resilient_parsing:
            ctx.meta[ALL] = True
            say(ctx.get_help())
            ctx.exit()

    return click.Option(
        ["--help-all"],
        is_flag=True,
        is_eager=True,
        expose_value=False,
        callback=show,
        help="Explain every option, and exit.",
    )


def declared_flags(
    declared: Mapping[str, Option],
    section: str,
    *,
    defaults: Mapping[str, Any] | None = None,
    grid: bool = False,
    rare: Sequence[str] | None = None,
) -> list[Flag]:
    """Make the flags of declared options.

    Args:
        declared: name -> option, see ``jaxpf.contract.options.options_of``.
        section: help section.
        defaults: defaults that differ from the declared ones.
        grid: whether each flag takes several comma-separated values; an option of several numbers
            is repeated instead.
        rare: for a command's own options: those explained by ``--help-all`` only.
    """
    flags = []
    for option in declared.values():
        default = (defaults or {}).get(option.name, option.default)
        about: dict[str, Any] = {
            "section": section,
            "common": option.common if rare is None else option.name not in rare,
            "help": _help(option, default, states_off=rare is None),
        }
        spellings = [option.flag, *option.flags, option.name]
        if option.kind is bool:
            about |= {"is_flag": True, "default": None}
            if option.default or rare is None:
                spellings[0] = f"{option.flag}/--no-{option.flag.removeprefix('--')}"
        else:
            about["type"], about["multiple"] = _click_type(option, grid)
        flags.append(Flag(spellings, **about))
    return flags


def _help(option: Option, default: object, *, states_off: bool) -> str:
    """What the option does, its choices, and its default; of a boolean "off" only on request."""
    text = option.help
    if option.name != "method" and not all(choice in text for choice in option.choices):
        effect, *more = text.split(".  ", 1)
        text = ".  ".join([f"{effect.removesuffix('.')}: {_either(option.choices)}.", *more])
    if default is None or default == () or "default" in text:
        return text
    if isinstance(default, bool):
        shown = "on" if default else "off" if states_off else ""
    else:
        shown = plain(default)
    return f"{text}  [default: {shown}]" if shown else text


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


def filter_flags(
    defaults: Mapping[str, Any],
    *,
    grid: bool = False,
    without: Sequence[str] = (),
    methods: Sequence[str] = (),
    family: "Filter | None" = None,
    unsuited: Sequence[str] = (),
) -> list[Flag]:
    """Make the flags of all filters: first those shared by several filters, then those of each.

    Args:
        defaults: target defaults that differ from the filters'.
        grid: see ``declared_flags``.
        without: names to omit.
        methods: methods whose filters have flags; default all.
        family: filter whose methods and options ``--help`` shows; ``--help-all`` shows the rest.
            Default all.
        unsuited: methods that the target refuses, which are not shown.
    """
    families = list(filters.all_filters().values())
    meant = options_of(
        *(each.build for each in families if not methods or set(each.methods) & set(methods))
    )
    shared: dict[str, Option] = {}
    for each in families:
        for name, declared in options_of(each.build).items():
            if sum(name in options_of(other.build) for other in families) > 1:
                first = shared.setdefault(name, declared)
                if declared.help not in first.help:
                    shared[name] = dataclasses.replace(first, help=f"{first.help}  {declared.help}")
    method = shared["method"]
    shown = filters.methods() if family is None else family.methods
    names = f"Sampling: {_either([name for name in shown if name not in unsuited])}."
    if others := [name for name in filters.methods() if name not in (*shown, *unsuited)]:
        names += f"  Other families: {', '.join(others)}."
    shared["method"] = dataclasses.replace(method, help=f"{names}  {method.help}")
    sections, refused = {"Filter": shared}, set()
    for each in families:
        if set(each.methods) <= set(unsuited):
            refused.add(_section(each))
        own = options_of(each.build)
        sections[_section(each)] = {n: own[n] for n in own if n not in shared}
    flags = []
    for title, options in sections.items():
        chosen = {n: option for n, option in options.items() if n in meant and n not in without}
        for flag in declared_flags(chosen, title, defaults=defaults, grid=grid):
            flag.is_named = family is None or title in ("Filter", _section(family))
            flag.hidden = title in refused
            flags.append(flag)
    return flags


def _section(family: "Filter") -> str:
    """Title of the help section for a filter's own options."""
    return _FOR + ", ".join(family.methods)


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


def refuse_others(values: Mapping[str, Any], target: "Target", filter_: "Filter") -> None:
    """Refuse options of another target or another filter.

    Args:
        values: values of flags.
        target: the target.
        filter_: the filter that tracks it.
    """
    own = options_of(target.tracker, filter_.build)
    of_targets = {name: options_of(each.tracker) for name, each in all_targets().items()}
    of_filters = [(each, options_of(each.build)) for each in filters.all_filters().values()]
    for name in [name for name in given_in(values) if name not in own]:
        methods = [
            method
            for family, options in of_filters
            if name in options
            for method in family.methods
            if options[name].applies({"method": method}) and method not in target.unsuited
        ]
        flag = f"--{name.replace('_', '-')}"
        if methods:
            raise InputError(
                f"{flag} works only with --method {' or '.join(methods)}, and this run uses the "
                f"{filter_.name} filter; leave it out, or use --method {methods[0]}."
            )
        if owners := [kind for kind, options in of_targets.items() if name in options]:
            raise InputError(
                f"{flag} works only for {' and '.join(owners)}, and the targets are {target.name}; "
                "leave it out."
            )
