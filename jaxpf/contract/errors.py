"""The one exception type for mistakes a user can make and mend."""

from collections.abc import Collection
from typing import Any


class InputError(ValueError):
    """Bad input: one sentence that names the value, the place and the remedy.

    The command line prints the sentence without a traceback and exits with 2.
    Everything else that is raised is a fault of the program.
    """


def check_known(shown: str, value: Any, known: Collection[str]) -> None:
    """Refuse a name that is not known.

    Args:
        shown: what the sentence begins with, before the name, such as ``"swap="``.
        value: what was given.
        known: all names.

    Raises:
        InputError: with those that there are.
    """
    if value not in known:
        raise InputError(f"{shown}{value!r} is unknown; choose one of {', '.join(known)}.")
