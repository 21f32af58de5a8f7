"""The command line, run or only parsed in the process of the test."""

import contextlib
import io
from typing import NamedTuple

import jax
import numpy as np

from jaxpf import cli
from jaxpf.cli.tracking.command import TrackCommand
from jaxpf.cli.tracking.request import request_of
from jaxpf.cli.tracking.run import read_starts, tracker_of
from jaxpf.media import open_frames
from jaxpf.targets.registry import find_target


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


def refusal_of(*arguments):
    """The one sentence with which the command line refuses, and prints nothing else."""
    outcome = jaxpf(*arguments)
    assert (outcome.code, outcome.out) == (2, ""), outcome
    assert "Traceback" not in outcome.err
    *_, sentence = outcome.err.strip().splitlines()
    assert sentence.startswith("Error: ")
    return sentence


def asked_of_track(target, *arguments):
    """What the arguments of ``jaxpf track`` ask for; nothing is opened."""
    target = find_target(target)
    with TrackCommand(target).make_context("track", list(map(str, arguments))) as context:
        return request_of(context, target)


def started_by_track(target, *arguments):
    """Where ``jaxpf track`` starts; no tracker is built."""
    request = asked_of_track(target, *arguments)
    return read_starts(request, open_frames(request.video))[0]


def built_by_track(target, *arguments):
    """Where ``jaxpf track`` starts and the tracker that it builds, which is not run."""
    request = asked_of_track(target, *arguments)
    source = open_frames(request.video)
    start, _ = read_starts(request, source)
    return start, tracker_of(request, source, next(source.frames(request.run.start)), start)


def assert_same(one, other):
    """Two trackers, or parts of them, are equal bit for bit."""
    assert jax.tree.structure(one) == jax.tree.structure(other)
    jax.tree.map(np.testing.assert_array_equal, one, other)
