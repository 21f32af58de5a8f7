"""What ``jaxpf track --smooth`` leaves besides: tracks given all frames, and how sure those are."""

import contextlib
from typing import Any

import click
import numpy as np

from jaxpf.cli.tracking.uncertainty_table import UncertaintyWriter
from jaxpf.smoothing import LookBack


class SmoothedTracks:
    """Writes smoothed.csv and smoothed_uncertainty.csv; it closes as a context does."""

    def __init__(self, recorder: Any, key: Any, total: int | None):
        """Create both files.

        Args:
            recorder: of the run.
            key: with which it tracks.
            total: frames that it will track; None where nobody knows.
        """
        output, request, start = recorder.output, recorder.request, recorder.start_at
        run, adapter, tracker = request.run, request.adapter, recorder.filter
        before = recorder.before[1]
        self._look_back = LookBack(tracker, key, run.smooth_lag, total, first=before)
        self._first, self._start = run.start, start
        self._shapes = lambda estimate: request.target.shapes(start, np.asarray(estimate), tracker)
        self._stack = contextlib.ExitStack()
        enter = self._stack.enter_context
        self._tracks = enter(adapter.track_writer(output / "smoothed.csv", start))
        names, size = request.target.coordinates, tracker.initial.shape[-1]
        self._uncertainty = enter(
            UncertaintyWriter(output / "smoothed_uncertainty.csv", names, size, quantiles=False)
        )
        if before == 0:
            self._append(run.start, start.shapes)

    def __enter__(self) -> "SmoothedTracks":
        return self

    def __exit__(self, *exception: Any) -> Any:
        return self._stack.__exit__(*exception)

    def add(self, state: Any) -> None:
        """The filter's state in the next frame."""
        self._write(self._look_back.add(state))

    def finish(self) -> None:
        """Nothing follows."""
        self._write(self._look_back.finish())
        if self._look_back.broken:
            click.echo(
                f"Note: {self._look_back.broken} moves of smoothed tracks fit no particle; more "
                "particles (-n) help.",
                err=True,
            )

    def _write(self, frames: Any) -> None:
        for frame in frames:
            number = self._first + 1 + frame.time
            self._append(number, self._shapes(frame.estimate))
            self._uncertainty.append(number, self._start.ids, frame.estimate, frame.spread)

    def _append(self, number: int, shapes: Any) -> None:
        self._tracks.append(number, np.asarray(shapes, float), np.zeros(len(shapes), bool))
