"""Keeps OpenCV and its libraries from printing: jaxpf reports problems in its own messages."""

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager

_lock = threading.Lock()


@contextmanager
def quiet_opencv() -> Iterator[None]:
    """Discard what is printed to standard error in the block.

    The libraries that decode pictures print past OpenCV's log level, so the file descriptor is
    redirected; that holds for the process, so blocks are short, and one at a time.
    """
    with _lock:
        try:
            usual = os.dup(2)
        except OSError:  # there is no standard error
            yield
            return
        nothing = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nothing, 2)
        os.close(nothing)
        try:
            yield
        finally:
            os.dup2(usual, 2)
            os.close(usual)
