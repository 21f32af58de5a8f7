"""Flags of commands, typed or read from a TOML file; most are those of declared options.

``jaxpf.contract.options`` declares an option; rare ones are typed ``--set NAME=VALUE``.
"""

import errno
import tomllib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import click

from jaxpf.contract.errors import Argument, InputError
from jaxpf.contract.numbers import plain
from jaxpf.contract.options import OPEN, Option, applying, complete, options_of
from jaxpf.files.writing import atomic_write

_SET = "A further option, NAME=VALUE; repeat it.  They are {names}, explained in {where}."


class GivenPath(click.Path):
    """A path that can be resolved and is not empty, as an unset variable of the shell is."""

    def __init__(self) -> None:
        super().__init__(path_type=Path)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Convert text to a ``Path``."""
        if value == "":
            self.fail("it is empty; give a path, or . for this folder.", param, ctx)
        path: Any = super().convert(value, param, ctx)
        try:
            path.stat()
        except OSError as error:
            if error.errno == errno.ELOOP:  # resolving it would raise a RuntimeError
                self.fail(f"symbolic links at '{path}' form a loop; give another path.", param, ctx)
        return path


class NumberList(click.ParamType):
    """Numbers separated by commas, such as ``4,2,0.003``."""

    def __init__(self, kind: type = float, length: int | None = None):
        self.kind, self.length = kind, length
        self.name = "whole numbers" if kind is int else "numbers"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Convert text or a TOML list to numbers."""
        parts = value.split(",") if isinstance(value, str) else list(value)
        try:
            numbers = [self.kind(part) for part in parts]
        except (TypeError, ValueError):
            self.fail(f"{value!r} is not {self.name} separated by commas.", param, ctx)
        if self.length is not None and len(numbers) != self.length:
            self.fail(
                f"{value!r} holds {len(numbers)} number(s); give {self.length} of them.", param, ctx
            )
        return numbers


class Flag(click.Option):
    """An option with its section in the help."""

    def __init__(self, *spellings: Any, section: str = "Options", **about: Any):
        super().__init__(*spellings, **about)
        self.section = section


class Command(click.Command):
    """A command with help in sections, whose messages name flags instead of arguments.

    A rare option is a hidden flag ``--set NAME``, which is typed ``--set NAME=VALUE``.
    """

    def __init__(self, *arguments: Any, where: str = "", **settings: Any):
        """Make the command; ``where`` the rare options are explained, the rest as by click."""
        super().__init__(*arguments, **settings)
        self.rare = sorted(str(each.name) for each in self.params if getattr(each, "hidden", False))
        own = next((each for each in self.params if each.name == "set"), None)
        self.takes_others = own is not None
        if self.rare:
            if own is None:
                section = getattr(self.params[-1], "section", "Options")
                own = Flag(["--set"], section=section, metavar="NAME=VALUE", expose_value=False)
                self.params.append(own)
            assert isinstance(own, click.Option)
            about = _SET.format(names=", ".join(self.rare), where=where)
            own.help = f"{own.help}  {about}" if own.help else about

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse as click does, after ``--set NAME=VALUE`` has become one word."""
        given, words = [], iter(args if self.rare else ())
        for word in words:
            if word == "--":
                given += [word, *words]
            elif word == "--set" and (text := next(words, None)) is not None:
                given.append(self._set(text))
            elif word.startswith("--set="):
                given.append(self._set(word.removeprefix("--set=")))
            else:
                given.append(word)
        return super().parse_args(ctx, given if self.rare else args)

    def _set(self, text: str) -> str:
        name, value = pair("--set", text, str)
        if (rare := name.replace("-", "_")) in self.rare:
            return f"--set {rare}={value}"
        if not self.takes_others:
            known = ", ".join(self.rare)
            raise InputError(f"--set {name} is not an option; there are {known}.")
        return f"--set={text}"

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

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command and show its errors with the names of its flags."""
        options = [param for param in self.params if isinstance(param, click.Option)]
        flags = {str(param.name): max(param.opts, key=len) for param in options}

        def show(argument: Argument) -> str:
            # The frames of a clip are `num_frames` in Python.
            flag = flags.get(argument.name) or flags.get(argument.name.removeprefix("num_"))
            if flag is None:
                return str(argument)
            value = argument.typed or argument.value
            joint = "=" if argument.name in self.rare else " "
            return flag if value == "" else f"{flag}{joint}{value}"

        try:
            return super().invoke(ctx)
        except InputError as error:
            raise InputError(error.shown(show)) from error


def pair(option: str, text: str, convert: Callable[[str], Any]) -> tuple[str, Any]:
    """Parse ``NAME=VALUE``."""
    name, equals, value = text.partition("=")
    if not (equals and name.strip() and value.strip()):
        raise InputError(f"{option} {text!r} must have the form NAME=VALUE.")
    return name.strip(), convert(value.strip())


# Flags that several commands have


def whole(*spellings: str, default: int | None, least: int = 0, most: int, help: str) -> Callable:
    """An option that is a whole number."""
    kind = click.IntRange(least, most)
    return click.option(
        *spellings, type=kind, default=default, show_default=default is not None, help=help
    )


def output(help: str, default: str | None = None) -> Callable:
    """The option ``--output``; without ``default`` its help says what the default is."""
    place = None if default is None else Path(default)
    spellings = ("--output", "-o")
    return click.option(
        *spellings, type=GivenPath(), default=place, show_default=place is not None, help=help
    )


#: The option ``--range`` of a film, as that of ``jaxpf track``.
grey_range = click.option(
    "--range",
    type=NumberList(int, 2),
    metavar="LOW,HIGH",
    help="Values that become black and white (images of 16 bits only).",
)

#: The option ``--overwrite`` of an output folder.
overwrite = click.option("--overwrite", is_flag=True, help="Replace files in an existing folder.")

#: The option ``--overwrite`` of an output file.
overwrite_file = click.option("--overwrite", is_flag=True, help="Replace an existing file.")


def config_flag(section: str = "Options") -> Flag:
    """``--config FILE``: read option defaults from the command's table in a TOML file."""
    return Flag(
        ["--config"],
        section=section,
        metavar="FILE",
        callback=_load,
        is_eager=True,
        expose_value=False,
        help="TOML file with options; command-line options override it.  Every run writes one.",
    )


# Declared options


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
        about: dict[str, Any] = {"section": section, "hidden": option.rare}
        about["help"] = _help(option, default)
        spelling = option.flag
        if option.kind is bool and not option.rare:
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
    if not grid or option.kind is bool:
        return option.kind, False
    return (str if option.kind is str else NumberList(option.kind)), False


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


def parse(
    values: Mapping[str, Any],
    *owners: Callable[..., Any],
    defaults: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """The checked values of the options of functions and dataclasses, from those of flags.

    Args:
        values: name -> value of a flag, None if it was not given; other names are ignored.
        owners: what declares the options, such as a target's factory and ``Filter.build``.
        defaults: defaults that override the declared ones.
    """
    given = {}
    for name, option in options_of(*owners).items():
        value = values.get(name)
        if value == "":  # as an unset variable of the shell is
            raise InputError(f"{option.flag} is empty; give a value, or leave it out.")
        if option.places and value not in (None, OPEN):
            if any(place < 1 for place in value):
                raise InputError(f"{option.flag} {plain(value)} is too small; it counts from 1.")
            value = tuple(place - 1 for place in value)
        if value not in (None, ()):
            given[name] = value
    return complete(given, *owners, defaults=defaults)


def as_typed(values: Mapping[str, Any], *owners: Callable[..., Any]) -> dict[str, Any]:
    """The owners' applicable options in command-line notation, by name; None for the rest."""
    applicable, typed = applying(values, *owners), {}
    for name, option in options_of(*owners).items():
        value = applicable.get(name)
        if option.places and value and value != OPEN:
            value = [place + 1 for place in value]
        typed[name] = value
    return typed


# Configuration files


def target_in(arguments: Sequence[str]) -> str | None:
    """The kind of target named in the ``--config`` file, or None."""
    for index, argument in enumerate(arguments):
        flag, equals, path = argument.partition("=")
        if flag == "--config" and (equals or index + 1 < len(arguments)):
            path = path if equals else arguments[index + 1]
            target = _table(Path(path), "track").get("target")
            return None if target is None else str(target)
    return None


def _table(path: Path, name: str) -> dict[str, Any]:
    """The table of a command in a TOML file."""
    try:
        with open(path, "rb") as file:
            content = tomllib.load(file)
    except OSError as error:
        raise InputError(
            f"cannot read the configuration '{path}': {(error.strerror or '').lower()}; check the "
            "path."
        ) from None
    except RecursionError:
        raise InputError(
            f"the configuration '{path}' is nested too deeply; write a table [{name}] of options."
        ) from None
    except ValueError as error:  # bad TOML, bad UTF-8, or a huge number
        cause = str(error).partition(";")[0]
        raise InputError(
            f"the configuration '{path}' is not valid TOML: {cause}; correct that line."
        ) from None
    table = content.get(name)
    if not isinstance(table, dict):
        raise InputError(f"the configuration '{path}' has no table [{name}]; add one.")
    return table


def _load(ctx: click.Context, param: click.Parameter, path: str | None) -> str | None:
    """Read the options of a configuration file, as typed ones; the callback of ``--config``."""
    if path is None:
        return None
    name = getattr(ctx.command, "table", ctx.command.name) or ""
    table = _table(Path(path), name)
    target = getattr(ctx.command, "target", None)
    if target is not None and table.pop("target", target.name) != target.name:
        raise InputError(
            f"the configuration '{path}' is not for {target.name}; leave '{target.name}' out "
            "before the video, or choose another configuration."
        )
    accepted = {str(param.name): param for param in ctx.command.params if param.expose_value}
    ctx.default_map = options = {}
    for key, value in table.items():
        option = accepted.get(key.replace("-", "_"))
        if option is None:
            raise InputError(
                f"the configuration '{path}' sets '{key[:40]}' in [{name}], which is not an "
                f"option; the options are {', '.join(sorted(accepted))}."
            )
        several = isinstance(option, click.Option) and option.multiple
        keeps_list = isinstance(value, list) and (several or isinstance(option.type, NumberList))
        value = [*map(_text, value)] if keeps_list else _text(value)
        value = [value] if several and isinstance(value, str) else value
        try:
            if "\0" in str(value):
                raise click.BadParameter(f"{value!r:.80} holds a NUL.")
            option.type_cast_value(ctx, value)
        except click.BadParameter as error:
            raise InputError(
                f"the configuration '{path}' sets '{key}' in [{name}]: {error.message:.200}"
            ) from None
        options[str(option.name)] = value
    return path


def _text(value: object) -> str:
    """A TOML value as it is typed on the command line."""
    if isinstance(value, list):
        return ",".join(map(_text, value))
    return str(value).lower() if isinstance(value, bool) else str(value)


def write_config(path: Path, command: str, options: Mapping[str, Any]) -> None:
    """Write the TOML file that repeats a run; options that are None are omitted."""
    import tomli_w

    kept = {
        key: str(value) if isinstance(value, Path) else value
        for key, value in options.items()
        if value is not None
    }
    try:
        content = tomli_w.dumps({command: kept}).encode()
    except UnicodeEncodeError as error:
        line = error.object[: error.end].splitlines()[-1]
        raise InputError(
            f"the name in {line!a} is not UTF-8, so '{path}' cannot hold it; rename the file."
        ) from None
    with atomic_write(path, "wb") as file:
        file.write(content)
