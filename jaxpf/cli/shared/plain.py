"""Commands whose errors use command-line notation, ``--frames 0``, and their usual options."""

import errno
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import click

from jaxpf.contract.errors import Argument, InputError


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


class PlainCommand(click.Command):
    """A command whose error messages name flags instead of arguments."""

    #: Options without a flag of their own, by name.
    rare: Mapping[str, click.Option] = {}

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command and show its errors with the names of its flags."""
        flags = {
            str(param.name): max(param.opts, key=len)
            for param in self.params
            if isinstance(param, click.Option)
        }

        def show(argument: Argument) -> str:
            if argument.name in self.rare:
                value = argument.typed or argument.value
                return f"--set {argument.name}" + (f"={value}" if value != "" else "")
            # The frames of a clip are `num_frames` in Python.
            flag = flags.get(argument.name) or flags.get(argument.name.removeprefix("num_"))
            return argument.as_flag(flag) if flag else str(argument)

        try:
            return super().invoke(ctx)
        except InputError as error:
            raise InputError(error.shown(show)) from error


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
