"""Configuration files: read and write TOML tables of a command's options."""

import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from jaxpf.cli.shared.flags import Flag
from jaxpf.cli.shared.plain import NumberList
from jaxpf.contract.errors import InputError
from jaxpf.files.writing import atomic_write
from jaxpf.targets.registry import find_target


def _load(ctx: click.Context, param: click.Parameter, path: str | None) -> str | None:
    if path is not None:
        ctx.default_map = _read_config(Path(path), ctx)
    return path


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


def target_in(arguments: Sequence[str]) -> str | None:
    """The kind of target named in the ``--config`` file, or None."""
    for index, argument in enumerate(arguments):
        flag, equals, path = argument.partition("=")
        if flag == "--config" and (equals or index + 1 < len(arguments)):
            path = path if equals else arguments[index + 1]
            target = _table(Path(path), "track").get("target")
            return None if target is None else find_target(str(target)).name
    return None


def _table(path: Path, name: str) -> dict[str, Any]:
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


def _read_config(path: Path, ctx: click.Context) -> dict[str, Any]:
    name = getattr(ctx.command, "table", ctx.command.name) or ""
    table = _table(path, name)
    target = getattr(ctx.command, "target", None)
    if target is not None and table.pop("target", target.name) != target.name:
        raise InputError(
            f"the configuration '{path}' is not for {target.name}; leave '{target.name}' out "
            "before the video, or choose another configuration."
        )
    accepted = {str(param.name): param for param in ctx.command.params if param.name != "config"}
    accepted |= getattr(ctx.command, "rare", {})
    options = {}
    for key, value in table.items():
        param = accepted.get(key.replace("-", "_"))
        if param is None:
            raise InputError(
                f"the configuration '{path}' sets '{key[:40]}' in [{name}], which is not an "
                f"option; the options are {', '.join(sorted(accepted))}."
            )
        several = isinstance(param, click.Option) and param.multiple
        keeps_list = isinstance(value, list) and (several or isinstance(param.type, NumberList))
        value = [*map(_as_typed, value)] if keeps_list else _as_typed(value)
        value = [value] if several and isinstance(value, str) else value
        try:
            if "\0" in str(value):
                raise click.BadParameter(f"{value!r:.80} holds a NUL.")
            param.type_cast_value(ctx, value)
        except click.BadParameter as error:
            raise InputError(
                f"the configuration '{path}' sets '{key}' in [{name}]: {error.message:.200}"
            ) from None
        options[str(param.name)] = value
    return options


def _as_typed(value: object) -> str:
    """A TOML value as it is typed on the command line."""
    if isinstance(value, list):
        return ",".join(map(_as_typed, value))
    return str(value).lower() if isinstance(value, bool) else str(value)


def write_config(path: Path, command: str, options: dict[str, Any]) -> None:
    """Write the TOML file that repeats a run; options that are None are omitted."""
    import tomli_w

    kept = {key: _plain(value) for key, value in options.items() if value is not None}
    try:
        content = tomli_w.dumps({command: kept}).encode()
    except UnicodeEncodeError as error:
        line = error.object[: error.end].splitlines()[-1]
        raise InputError(
            f"the name in {line!a} is not UTF-8, so '{path}' cannot hold it; rename the file."
        ) from None
    with atomic_write(path, "wb") as file:
        file.write(content)


def _plain(value: Any) -> Any:
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return str(value) if isinstance(value, Path) else value
