"""Click options of declared options: one loop for flags, help, TOML keys and grids."""

import dataclasses
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import click

from jaxpf import filters
from jaxpf.cli.common import NumberList
from jaxpf.errors import InputError
from jaxpf.options import Option, implied, options_of, plain
from jaxpf.targets import DEFAULT, targets
from jaxpf.targets.target import Target


def owners() -> dict[str, tuple[type, Mapping[str, Any]]]:
    """Whose options there are: name -> (class of options, other defaults)."""
    found: dict[str, tuple[type, Mapping[str, Any]]] = {}
    by_default_first = sorted(targets().items(), key=lambda item: item[0] != DEFAULT)
    for one in filters.filters().values():
        found[one.name] = one.options, {}
    for name, target in by_default_first:
        found[name] = target.options, target.defaults
    return found


def all_options(without: tuple[str, ...] = ()) -> dict[str, Option]:
    """Every declared option of filters and targets, by name; helps that differ are joined."""
    found: dict[str, Option] = {}
    for options, _ in owners().values():
        for name, one in options_of(options).items():
            known = found.setdefault(name, one)
            if one.help not in known.help:
                found[name] = dataclasses.replace(known, help=f"{known.help}  {one.help}")
    return {name: one for name, one in found.items() if name not in without}


def declared_options(
    *,
    grid: bool = False,
    only: tuple[str, ...] | None = None,
    without: tuple[str, ...] = (),
    defaults: Mapping[str, Any] | None = None,
) -> Callable:
    """A decorator that adds the flags of all declared options.

    Args:
        grid: for several values of each, separated by commas; an option of several numbers is
            repeated instead.
        only: names to take.
        without: names to leave out.
        defaults: where a command's differ.
    """

    def add(command: Callable) -> Callable:
        for one in reversed(all_options(without).values()):
            if only is not None and one.name not in only:
                continue
            text = f"{one.help}  {_defaults(one, defaults or {})}"
            told = one.name == "method" or all(choice in text for choice in one.choices)
            if not told:
                text = f"{', '.join(one.choices)}.  {text}"
            kind, multiple = _click_type(one, grid)
            flags = (one.flag, *one.flags, one.name)
            command = click.option(*flags, type=kind, multiple=multiple, help=text)(command)
        return command

    return add


def options_of_owner(owner: type) -> Callable:
    """A decorator that adds the flags of one class of options, which belongs to one command."""

    def add(command: Callable) -> Callable:
        for one in reversed(options_of(owner).values()):
            default = "" if one.default is None else f"  [default: {plain(one.default)}]"
            kind, _ = _click_type(one, False)
            command = click.option(one.flag, one.name, type=kind, help=one.help + default)(command)
        return command

    return add


def start_options() -> Callable:
    """A decorator that adds the flags by which targets are told where they start."""

    def add(command: Callable) -> Callable:
        for target in targets().values():
            for name, about in reversed(list(target.start_flags.items())):
                kind = about.get("type", str)
                if isinstance(kind, list):
                    given: Any = NumberList(kind[0])
                else:
                    given = click.Path(path_type=Path) if kind is Path else kind
                flag = f"--{name.replace('_', '-')}"
                command = click.option(flag, **{**about, "type": given})(command)
        return command

    return add


def target_of(given: Mapping[str, Any]) -> Target:
    """The target that ``--target`` names, or else the one whose start flags are given.

    Raises:
        InputError: flags of several targets, or of another than the one that is named.
    """
    known = targets()
    if given.get("target") and given["target"] not in known:
        raise InputError(
            f"--target {given['target']!r} is unknown; choose one of {', '.join(known)}."
        )
    told = {
        name: next((flag for flag in one.start_flags if given.get(flag)), None)
        for name, one in known.items()
    }
    if given.get("target"):
        told[given["target"]] = "target"
    meant = [name for name, flag in told.items() if flag]
    if len(meant) > 1:
        one, other = (f"--{str(told[n]).replace('_', '-')} is about {n}" for n in meant[:2])
        raise InputError(f"{one} and {other}; use one of them.")
    return known[meant[0] if meant else DEFAULT]


def picked(
    values: Mapping[str, Any], owner: type, defaults: Mapping[str, Any] | None = None
) -> Any:
    """An instance of a class of options from flags; those that were not given have defaults.

    Raises:
        InputError: a value out of range; the sentence names the flag.
    """
    given = {
        name: one.checked(_from_people(one, values[name]), one.flag)
        for name, one in options_of(owner).items()
        if values.get(name) is not None
    }
    found = {**(defaults or {}), **given}
    found |= implied(owner, {name: [value] for name, value in given.items()})
    return owner(**{name: value for name, value in found.items() if name in options_of(owner)})


def refuse_others(values: Mapping[str, Any], *used: Any) -> None:
    """Refuse flags that were given and belong to none of the classes of options in use.

    Raises:
        InputError: which flag.
    """
    known = options_of(*used)
    for name, one in all_options().items():
        if values.get(name) not in (None, ()) and name not in known:
            raise InputError(f"{one.flag} is no option of what is tracked here; leave it out.")


def _from_people(one: Option, value: Any) -> Any:
    """People count places from 1."""
    if not one.places:
        return value
    if any(place < 1 for place in value):
        raise InputError(f"{one.flag} {plain(value)} counts from 1; name no place below.")
    return tuple(place - 1 for place in value)


def _click_type(one: Option, grid: bool) -> tuple[Any, bool]:
    if one.length:
        counted = one.length > 0 and not one.per_object
        return NumberList(one.kind, one.length if counted else None), grid
    if not grid or one.kind is bool:
        return one.kind, False
    return (str if one.kind is str else NumberList(one.kind)), False


def _defaults(one: Option, other: Mapping[str, Any]) -> str:
    """``[default: 20; parts: 50]``; nothing where it is left open."""
    found: dict[str, str] = {}
    for name, (options, defaults) in owners().items():
        declared = options_of(options)
        if "default" in found and name in filters.filters():
            continue  # of another filter's methods, which have names of their own
        if one.name in declared or one.name in defaults:
            value = defaults.get(one.name, declared.get(one.name, one).default)
            value = other.get(one.name, value)
            if value is not None and plain(value) != found.get("default"):
                found[name if "default" in found else "default"] = plain(value)
    return f"[{'; '.join(f'{name}: {value}' for name, value in found.items())}]" if found else ""
