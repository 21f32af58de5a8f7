"""The exception type for errors that the user can fix."""

from collections.abc import Collection
from typing import Any


class InputError(ValueError):
    """Bad input; the message is one sentence that names the value, the place and the remedy.

    The command line prints it without a traceback and exits with 2.  Any other exception is a bug.
    """


def check_known(shown: str, value: Any, known: Collection[str]) -> None:
    """Refuse a name that is not in ``known``.

    Args:
        shown: start of the message, before the name, such as ``"swap="``.
        value: the given name.
        known: all valid names.

    Raises:
        InputError: lists the valid names.
    """
    if value not in known:
        raise InputError(f"{shown}{value!r} is unknown; choose one of {', '.join(known)}.")
