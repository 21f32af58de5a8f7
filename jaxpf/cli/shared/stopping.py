"""Handle Ctrl-C and SIGTERM: acknowledge at once, then write the results that are complete."""

import _thread
import contextlib
import os
import signal
import socket
import sys
import threading
import time
from collections.abc import Iterator
from types import FrameType

from jaxpf.cli.shared.console import say

#: A second Ctrl-C ends the program only after these seconds, if the first had no effect yet.
_MEANT = 1.0


class Terminated(KeyboardInterrupt):
    """The system asked the program to end (SIGTERM, SIGHUP); handled like Ctrl-C."""


#: Signals that ask the program to end; SIGHUP comes when the terminal is closed.
_ENDING = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]


def heed_ctrl_c() -> None:
    """Make Ctrl-C end this program at any time; call it in the main thread.

    Python drops an interrupt, or a request to end, that arrives inside a callback, such as JAX's on
    garbage collection; this raises it again.  Python handles no signals while JAX compiles: a
    second Ctrl-C then ends the program at once, and the next run removes its leftovers.  JAX
    crashes on an interrupt while it is imported, when nothing needs to be written: the program
    ends at once.
    """
    if signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        return  # SIGINT is ignored, or another program handles it
    usual = sys.unraisablehook

    def lost(unraisable: "sys.UnraisableHookArgs") -> None:
        if issubclass(unraisable.exc_type, KeyboardInterrupt):
            ending = issubclass(unraisable.exc_type, Terminated)
            again = signal.SIGTERM if ending else signal.SIGINT
            threading.Timer(0.01, _thread.interrupt_main, [again]).start()
        else:
            usual(unraisable)

    sys.unraisablehook = lost
    signal.signal(signal.SIGINT, _interrupt)
    read, written = socket.socketpair()
    written.setblocking(False)
    signal.set_wakeup_fd(written.fileno(), warn_on_full_buffer=False)
    threading.Thread(target=_end_at_second, args=(read, written), daemon=True).start()


def _interrupt(number: int, frame: FrameType | None) -> None:
    """Raise ``KeyboardInterrupt``, or end the program if JAX is being imported."""
    spec = getattr(sys.modules.get("jax"), "__spec__", None)
    if getattr(spec, "_initializing", False):
        os.write(2, b"Interrupted.\n")
        os._exit(130)
    signal.default_int_handler(number, frame)


def _end_at_second(read: socket.socket, written: socket.socket) -> None:
    """Watch this process's signals; the thread keeps ``written`` open."""
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
    """Print at once what happens when the program is asked to stop, then raise.

    Ctrl-C raises ``KeyboardInterrupt``, SIGTERM and SIGHUP ``Terminated``.  Signals that the
    program was started to ignore stay ignored.

    Args:
        saying: the line to print on standard error.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def stop(number: int, frame: FrameType | None) -> None:
        try:
            say(f"\n{saying}", err=True)
        except OSError:  # the terminal is gone, and later messages must not fail either
            nowhere = os.open(os.devnull, os.O_WRONLY)
            for stream in (1, 2):
                os.dup2(nowhere, stream)
        raise Terminated if number in _ENDING else KeyboardInterrupt

    before = {
        number: signal.getsignal(number)
        for number in (signal.SIGINT, *_ENDING)
        if signal.getsignal(number) not in (signal.SIG_IGN, None)
    }
    try:
        for number in before:
            signal.signal(number, stop)
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
