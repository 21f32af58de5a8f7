"""Ctrl-C and the request to end: said at once, and answered by what can still be written."""

import contextlib
import signal
import threading
from collections.abc import Iterator
from typing import Any

import click


class Terminated(KeyboardInterrupt):
    """The system asked the program to end (SIGTERM), which ends as by Ctrl-C."""


@contextlib.contextmanager
def announced_stop(saying: str) -> Iterator[None]:
    """Say at once what happens when the program is asked to stop, then raise.

    Ctrl-C raises ``KeyboardInterrupt``, SIGTERM ``Terminated``.  What the program was started to
    ignore it goes on ignoring.

    Args:
        saying: the line that is printed on standard error.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def stop(number: int, frame: Any) -> None:
        click.echo(f"\n{saying}", err=True)
        raise Terminated if number == signal.SIGTERM else KeyboardInterrupt

    before = {
        number: signal.getsignal(number)
        for number in (signal.SIGINT, signal.SIGTERM)
        if signal.getsignal(number) not in (signal.SIG_IGN, None)
    }
    try:
        for number in before:
            signal.signal(number, stop)
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
