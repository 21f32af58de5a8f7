"""Commands whose errors use command-line notation: ``--frames 0``, not ``num_frames = 0``."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from jaxpf.contract.errors import InputError


class GivenPath(click.Path):
    """A path that is not empty, as an unset variable of the shell is: that is no folder."""

    def __init__(self) -> None:
        super().__init__(path_type=Path)

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        """Convert text to a ``Path``."""
        if value == "":
            self.fail("it is empty; give a path, or . for this folder.", param, ctx)
        return super().convert(value, param, ctx)


class Speaking(click.Command):
    """A command whose error messages begin with the flag that was given."""

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command and translate its errors."""
        try:
            return super().invoke(ctx)
        except InputError as error:
            options = [param for param in self.params if isinstance(param, click.Option)]
            flags = {str(param.name): max(param.opts, key=len) for param in options}
            given = {name: flag for name, flag in flags.items() if ctx.params.get(name) is not None}
            raise InputError(_values_as_typed(_in_flags(str(error), given), flags)) from error


def _values_as_typed(text: str, flags: Mapping[str, str]) -> str:
    """Write values of options as flags: ``--swap none`` instead of ``swap='none'``."""
    return re.sub(
        r"\b(\w+)='(\w+)'",
        lambda found: f"{flags[found[1]]} {found[2]}" if found[1] in flags else found[0],
        text,
    )


def _in_flags(text: str, flags: Mapping[str, str]) -> str:
    """Replace argument names by flags, for arguments that were given as flags."""
    found = re.match(r"([a-z]\w*)(?: ?=|:| (?=is empty|names)) ?", text)
    if found is None:
        return text
    name = found[1]
    for one in (name, name.removeprefix("num_")):
        if one in flags:
            return f"{flags[one]} {text[found.end() :]}"
    return text
