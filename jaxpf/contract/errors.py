"""The exception type for errors that the user can fix."""

import importlib
from collections.abc import Callable, Collection
from types import ModuleType
from typing import NamedTuple


class Argument(NamedTuple):
    """An argument in a message, with its value: ``runs = 0``; ``--runs 0`` on the command line.

    Attributes:
        name: of the argument.
        value: as written in Python; "" shows the name alone.
        joint: between name and value.
        typed: the value as written on the command line; default ``value``.
    """

    name: str
    value: object = ""
    joint: str = " = "
    typed: str = ""

    def __str__(self) -> str:
        return f"{self.name}{self.joint}{self.value}" if self.value != "" else self.name


def choice(name: str, value: str) -> Argument:
    """A named choice in a message: ``motion='pixels'``; ``--motion pixels`` on the command line."""
    return Argument(name, repr(value), "=", value)


class InputError(ValueError):
    """Bad input; the message is one sentence that names the value, the place and the remedy.

    The command line prints it without a traceback and exits with 2.  Any other exception is a bug.

    Args:
        pieces: of the message, joined without spaces; an ``Argument`` is shown as its flag on the
            command line.
    """

    def __init__(self, *pieces: str | Argument):
        super().__init__("".join(map(str, pieces)))
        self.pieces = pieces

    def shown(self, show: Callable[[Argument], str]) -> str:
        """The message, with every ``Argument`` as ``show`` writes it."""
        return "".join(show(x) if isinstance(x, Argument) else x for x in self.pieces)


def import_extra(module: str, need: str, install: str = "'jaxpf[cli]'") -> ModuleType:
    """Import an optional module; if it is missing, say what has ``need`` of it, and the remedy."""
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError:
        raise InputError(f"{need}, which is missing; pip install {install}.") from None


def check_separate(what: str, *others: tuple[object, str]) -> None:
    """Refuse the setting ``what`` together with another one that is used, given as (used, name)."""
    for used, other in others:
        if used:
            raise InputError(f"{what} does not work with {other}; leave one of them out.")


def check_known(shown: str, value: object, known: Collection[str]) -> None:
    """Refuse a name that is not in ``known``; ``shown`` begins the message, such as ``"swap="``."""
    if not isinstance(value, str) or value not in known:
        raise InputError(f"{shown}{value!r} is unknown; choose one of {', '.join(known)}.")
