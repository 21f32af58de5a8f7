"""What several commands share: configuration files, tables, progress, the compile cache."""

import contextlib
import os
import sys
import tomllib
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import click

from jaxpf.errors import InputError
from jaxpf.files.writing import atomic_write


class NumberList(click.ParamType):
    """Numbers separated by commas, such as ``4,2,0.003``."""

    def __init__(self, kind: type = float, length: int | None = None):
        self.kind, self.length = kind, length
        self.name = "whole numbers" if kind is int else "numbers"

    def convert(self, value: Any, param: Any, ctx: Any) -> list[Any]:
        """Text or a list (from a TOML file) to a list of numbers."""
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


def config_option() -> Callable:
    """``--config FILE``: defaults for the options from the command's table in a TOML file."""

    def load(ctx: click.Context, param: click.Parameter, path: str | None) -> str | None:
        if path is not None:
            ctx.default_map = _read_config(Path(path), ctx)
        return path

    return click.option(
        "--config",
        metavar="FILE",
        callback=load,
        is_eager=True,
        expose_value=False,
        help="TOML file with options; what is given here too wins.  Every run writes one.",
    )


def _read_config(path: Path, ctx: click.Context) -> dict[str, Any]:
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
            f"the configuration '{path}' is nested too deeply; write a table [{ctx.command.name}] "
            "of options."
        ) from None
    except ValueError as error:  # of TOML, of UTF-8, of a number with thousands of digits
        cause = str(error).partition(";")[0]
        raise InputError(f"the configuration '{path}' is not valid TOML: {cause}.") from None
    name = ctx.command.name or ""
    table = content.get(name)
    if not isinstance(table, dict):
        raise InputError(f"the configuration '{path}' has no table [{name}]; add one.")
    known = {param.name: param for param in ctx.command.params if param.name != "config"}
    options = {}
    for key, value in table.items():
        param = known.get(key.replace("-", "_"))
        if param is None:
            raise InputError(
                f"the configuration '{path}' sets '{key[:40]}' in [{name}], which is no option; "
                f"the options are {', '.join(sorted(map(str, known)))}."
            )
        suits, wanted = _suits(param, value)
        if not suits:
            raise InputError(
                f"the configuration '{path}' sets '{key}' in [{name}] to {_shown(value)}; give "
                f"{wanted}."
            )
        if isinstance(param, click.Option) and param.multiple:
            value = [item if isinstance(item, str) else ",".join(map(str, item)) for item in value]
        options[str(param.name)] = value
    return options


def _suits(param: click.Parameter, value: Any) -> tuple[bool, str]:
    """Whether a TOML value has the option's type, which click would force it into; and the type."""
    kind = param.type
    if isinstance(param, click.Option) and param.multiple:
        suits = isinstance(value, list) and all(
            isinstance(item, str) or _are_numbers(item, float) for item in value
        )
        return suits, "a list such as [[120, 80, 40, 90], [300, 85, 42, 88]]"
    if isinstance(kind, NumberList):
        return isinstance(value, str) or _are_numbers(value, kind.kind), f"a list of {kind.name}"
    if isinstance(kind, click.types.BoolParamType):
        return isinstance(value, bool), "true or false"
    if isinstance(kind, click.types.IntParamType):
        return _are_numbers([value], int), "a whole number"
    if isinstance(kind, click.types.FloatParamType):
        return _are_numbers([value], float), "a number"
    return isinstance(value, str) and "\0" not in value, "a text in quotes"


def _are_numbers(values: Any, kind: type) -> bool:
    allowed = int if kind is int else int | float
    return isinstance(values, list) and all(
        isinstance(value, allowed)
        and not isinstance(value, bool)
        and (isinstance(value, float) or abs(value) < _LARGEST_WHOLE)
        for value in values
    )


def _shown(value: Any) -> str:
    """A value as TOML spells it, near enough for a message, and not too long for one."""
    if isinstance(value, int) and abs(value) >= _LARGEST_WHOLE:
        return f"a number beyond {_LARGEST_WHOLE}"
    text = str(value).lower() if isinstance(value, bool) else repr(value)
    return text if len(text) <= 80 else f"{text[:80]}..."


def write_config(path: Path, command: str, options: dict[str, Any]) -> None:
    """Write the TOML file that repeats a run; options that are None are left out."""
    import tomli_w

    kept = {key: _plain(value) for key, value in options.items() if value is not None}
    with atomic_write(path, "wb") as file:
        tomli_w.dump({command: kept}, file)


def _plain(value: Any) -> Any:
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return str(value) if isinstance(value, Path) else value


def resolved_scene(source: str) -> str:
    """A scene with its folder or file in full, so that run.toml works from anywhere."""
    place, colon, function = source.rpartition(":")
    if colon and Path(place).is_file():
        return f"{Path(place).resolve()}:{function}"
    path = Path(source)
    is_folder = path.exists() and (source != path.name or not _is_registered(source))
    return str(path.resolve()) if is_folder else source


def _is_registered(name: str) -> bool:
    import scenes

    return name in scenes.names()


def scene_name(source: str) -> str:
    """What to call the output folder of a scene."""
    return Path(source.rpartition(":")[2] or source).name


def names_in(text: str) -> list[str]:
    """Names separated by commas."""
    return [name.strip() for name in text.split(",") if name.strip()]


def start_jax(devices: int | None = None) -> None:
    """Set JAX up before it is first used: a host device for every core, and the compile cache.

    ``devices`` is their number; by default all cores that this process may use.
    """
    import jax

    from jaxpf.evaluation.execution import num_cores

    with contextlib.suppress(RuntimeError):  # in use already, by a program that called us
        jax.config.update("jax_num_cpu_devices", devices or num_cores())
    use_compile_cache()


def use_compile_cache() -> None:
    """Keep compiled kernels between runs, in ``JAXPF_CACHE_DIR`` or the user's cache folder."""
    import jax

    base = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    folder = os.environ.get("JAXPF_CACHE_DIR") or os.path.join(base, "jaxpf")
    try:
        os.makedirs(folder, exist_ok=True)
    except OSError:
        return  # no home, a read-only disk: compiling anew is slower, not wrong
    jax.config.update("jax_compilation_cache_dir", folder)
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.1)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)


#: Beyond this, whole numbers are no longer told apart once they are real ones.
_LARGEST_WHOLE = 2**53

#: What a table's words mean, by how they begin; a line under each table explains those it uses.
_TERMS = {
    "success at": "frames whose overlap is above that",
    "success area": "area under the curve of such frames over every overlap",
    "success": "tracked in every frame",
    "recover": "tracked in the last frame with truth",
    "unique": "particles that carry different draws of the object",
}


def print_table(title: str, columns: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Print a table, and what its terms mean.

    The first column is left-aligned, numbers right.  Nothing in the texts is markup.
    """
    from rich.console import Console
    from rich.table import Table

    table = Table(title=title, title_justify="left")
    for index, column in enumerate(columns):
        table.add_column(column, justify="left" if index == 0 else "right")
    rows = list(rows)
    for row in rows:
        table.add_row(*row)
    # A pipe or a file has no width: do not cut what is printed there.
    Console(width=None if sys.stdout.isatty() else 120, markup=False, emoji=False).print(table)
    if terms := _terms([*columns, *(row[0] for row in rows if row)]):
        click.echo(terms)


def _terms(names: Iterable[str]) -> str:
    """A sentence for each term among a table's columns and rows; "" where there is none."""
    used: dict[str, str] = {}
    for name in names:
        word = name.partition(",")[0].partition(" (")[0]
        known = (
            term for term in _TERMS if word.lower().removeprefix("smith2004 ").startswith(term)
        )
        term = next(known, None)
        if term and term not in used:
            used[term] = f"{word}: {_TERMS[term]}"
    if not used:
        return ""
    tracked = "tracked: overlapping the truth at all"
    needs = [tracked] if {"success", "recover"} & used.keys() else []
    return "; ".join([*used.values(), *needs]) + "."


def progress_bar(unit: str) -> Any:
    """A progress bar on standard error, with ``unit`` per second and the time left."""
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeRemainingColumn,
    )

    class Rate(TextColumn):
        def render(self, task: Any) -> Any:
            from rich.text import Text

            return Text("" if task.speed is None else f"{task.speed:.1f} {unit}/s")

    return Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        Rate(""),
        TextColumn("left"),
        TimeRemainingColumn(),
        console=Console(stderr=True),
    )
