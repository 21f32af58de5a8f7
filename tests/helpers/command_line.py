"""The command line, run in the process of the test."""

import contextlib
import io
from typing import NamedTuple

from jaxpf import cli


class Outcome(NamedTuple):
    code: int
    out: str
    err: str


def jaxpf(*arguments):
    """Run the command line in this process."""
    out, err, code = io.StringIO(), io.StringIO(), 0
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            cli.main([str(argument) for argument in arguments])
        except SystemExit as stop:
            code = stop.code
    return Outcome(code, out.getvalue(), err.getvalue())
