"""Ctrl-C and the request to end: said at once, and answered by what can still be written."""

import _thread
import contextlib
import os
import signal
import socket
import sys
import threading
import time
from collections.abc import Iterator
from typing import Any

import click

#: Seconds after which a second Ctrl-C is meant, and the first one had no effect yet.
_MEANT = 1.0


class Terminated(KeyboardInterrupt):
    """The system asked the program to end (SIGTERM), which ends as by Ctrl-C."""


def heed_ctrl_c() -> None:
    """See to it that Ctrl-C ends this program, whatever it is about; for its main thread.

    An interruption that meets a callback, such as those of JAX on garbage, is lost to it: Python
    says that it ignored it, and goes on.  It comes again then.  While JAX compiles, Python hears of
    nothing: a second Ctrl-C ends the program at once, leaving what the next run clears away.
    """
    if signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        return  # started to ignore it, or a part of another program
    usual = sys.unraisablehook

    def lost(unraisable: Any) -> None:
        if issubclass(unraisable.exc_type, KeyboardInterrupt):
            threading.Timer(0.01, _thread.interrupt_main).start()
        else:
            usual(unraisable)

    sys.unraisablehook = lost
    read, written = socket.socketpair()
    written.setblocking(False)
    signal.set_wakeup_fd(written.fileno(), warn_on_full_buffer=False)
    threading.Thread(target=_end_at_second, args=(read, written), daemon=True).start()


def _end_at_second(read: socket.socket, written: socket.socket) -> None:
    """Listen to the signals of this process; ``written`` is kept open with the thread."""
    first = None
    while numbers := read.recv(1):
        if numbers[0] != signal.SIGINT:
            continue
        if first is None:
            first = time.monotonic()
        elif time.monotonic() - first > _MEANT:
            os.write(2, b"\nInterrupted.\n")
            os._exit(130)


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
