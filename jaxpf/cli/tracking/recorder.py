"""What `jaxpf track` leaves behind: tracks, overlay, diagnostics, summary and metrics."""

import collections
import contextlib
import itertools
import json
import time
from pathlib import Path
from typing import Any

import click
import numpy as np

from jaxpf.cli.shared import console
from jaxpf.cli.tracking.uncertainty import UncertaintyTable
from jaxpf.contract.errors import InputError
from jaxpf.contract.names import PROBABLY_LOST
from jaxpf.files.versions import versions
from jaxpf.targets.adapter import Marks

#: Frames over which a trail reaches back.
_TRAIL = 20


class Recorder:
    """Writes everything that a run leaves behind, frame by frame."""

    def __init__(self, output, source, request, start, tracker):
        from jaxpf.files.writing import LineWriter
        from jaxpf.media.overlay import object_colours
        from jaxpf.media.video_writer import SUFFIXES, VideoWriter

        self.output, self.source, self.request = output, source, request
        self.adapter, self.start_at, self.tracker = request.adapter, start, tracker
        #: What the runs repeat, where there are many, or one that tells its errors.
        asks = request.run.runs or request.run.error_bars
        self.filter = tracker.tracker if asks else tracker
        #: The state of an earlier run, and how many frames it has seen.
        self.before: tuple[Any, int] = None, 0
        self.last: Any = None
        self.smoothed: Any = None
        self.ids = ids = start.ids
        self.colours = object_colours(len(ids))
        self.frames_outside: dict[str, list[int]] = {str(i): [] for i in ids}
        self.frames_without_likelihood: dict[str, list[int]] = {str(i): [] for i in ids}
        self.frames_probably_lost: dict[str, list[int]] = {str(i): [] for i in ids}
        self.total_confidence: Any = None
        self.past: collections.deque[np.ndarray] = collections.deque(maxlen=_TRAIL)
        self.num_tracked = self.num_invalid = self.num_impossible = 0
        self.seconds_first = self.seconds_rest = 0.0
        self._stack = contextlib.ExitStack()
        self.tracks = self._stack.enter_context(
            self.adapter.track_writer(output / "tracks.csv", start)
        )
        self.diagnostics = self._stack.enter_context(LineWriter(output / "diagnostics.csv"))
        self.uncertainty = self._stack.enter_context(UncertaintyTable(output, request, self.filter))
        self.video = self.window = None
        if request.run.overlay:
            self.video = self._stack.enter_context(
                VideoWriter(
                    output / f"overlay{SUFFIXES[request.run.codec]}",
                    source.width,
                    source.height,
                    source.fps,
                )
            )

    def __enter__(self):
        return self

    def __exit__(self, *exception):
        return self._stack.__exit__(*exception)

    def start(self, number, frame):
        """The start frame's row is where the objects were said to be; an earlier run has it."""
        if self.before[1]:
            return
        nobody = np.zeros(len(self.ids), bool)
        self.tracks.append(number, self.start_at.shapes, nobody)
        self._show_objects(frame, self.start_at.shapes, nobody)

    def follow(self, key, frames):
        """Track the frames after the start frame, or after those of the run that goes on."""
        from jaxpf.files import states

        start, limit = self.request.run.start, self.request.run.frames
        before = self.before[1]
        frames = itertools.islice(frames, before, limit)
        expected = self.source.num_frames or self.source.frames_expected
        total = None if expected is None else max(expected - start - 1, 0)
        if limit is not None:
            total = limit if total is None else min(total, limit)
        if self.request.run.smooths:
            from jaxpf.cli.tracking.smoothed import SmoothedTracks

            self.smoothed = self._stack.enter_context(SmoothedTracks(self, key, total))
        if total is not None:
            total = max(total - before, 0)
        clock = time.perf_counter()
        with console.progress_bar("frames") as progress:
            task = progress.add_task("compiling", total=total)
            try:
                for tracked in self._stream(key, frames):
                    self._record(start + 1 + tracked.time, tracked)
                    elapsed, clock = time.perf_counter() - clock, time.perf_counter()
                    if self.num_tracked == 1:
                        self.seconds_first = elapsed
                        progress.reset(task, total=total, completed=1, description="tracking")
                    else:
                        self.seconds_rest += elapsed
                        progress.advance(task)
            finally:
                # Also where Ctrl-C ended it: what was tracked is looked back over, and kept.
                if self.smoothed is not None and self.num_tracked:
                    progress.update(task, description="smoothing")
                    self.smoothed.finish()
                if self.request.run.save_state is not None and self.num_tracked:
                    states.save(self.request.run.save_state, self.last, before + self.num_tracked)
            progress.update(task, total=self.num_tracked)
        if self.num_tracked == 0:
            raise nothing_follows(self.source, start + before)

    def _stream(self, key, frames):
        from jaxpf.running.streaming import stream

        state, time = self.before
        return stream(self.tracker, key, frames, state=state, time=time)

    def _record(self, number, tracked):
        from jaxpf.evaluation.trackers import shapes_of

        summary = tracked.summary
        self.last = tracked.state
        if self.num_tracked + self.before[1] == 0 and not self.request.run.tracker:
            self.request.filter.check_first(summary, self.ids)
        found = np.asarray(
            shapes_of(self.filter, self.request.target, self.start_at, summary.estimate), float
        )
        lost = self._off_frame(found)
        for name in self.ids[lost]:
            self.frames_outside[str(name)].append(number)
        if getattr(summary, "lost", None) is not None:
            for name in self.ids[summary.lost]:
                self.frames_without_likelihood[str(name)].append(number)
            lost = lost | summary.lost
        confidence = getattr(summary, "confidence", None)
        self._note_summary(number, summary)
        self._note_confidence(number, confidence, lost)
        told = {} if confidence is None else {"confidence": confidence}
        self.tracks.append(number, found, lost, **told)
        self.uncertainty.append(number, tracked, self.ids)
        if self.smoothed is not None:
            self.smoothed.add(self.uncertainty.cloud(tracked.state))
        self.num_tracked += 1
        self._draw(tracked, found, lost)

    def _note_summary(self, number, summary):
        """A line of diagnostics; a user's tracker may report less than ours do."""
        unknown = np.full(len(self.ids), np.nan)
        ess, log_evidence = (float(getattr(summary, n, np.nan)) for n in ("ess", "log_evidence"))
        self.num_invalid += int(getattr(summary, "num_invalid", 0))
        self.num_impossible += int(np.isneginf(log_evidence))
        columns = {"uniqueness": getattr(summary, "uniqueness", unknown)}
        if getattr(summary, "confidence", None) is not None:
            columns["confidence"] = summary.confidence
        if self.num_tracked == 0:
            names = [f"{name}_{i}" for name in columns for i in self.ids]
            self.diagnostics.write_rows([["frame", "ess", "log_evidence", *names]])
        values = [ess, log_evidence, *np.concatenate([*columns.values()])]
        self.diagnostics.write_rows([[number, *(f"{value:.6g}" for value in values)]])

    def _note_confidence(self, number, confidence, lost):
        if confidence is None:
            return
        for name in self.ids[(confidence < PROBABLY_LOST) & ~lost]:
            self.frames_probably_lost[str(name)].append(number)
        known = 0.0 if self.total_confidence is None else self.total_confidence
        self.total_confidence = known + np.where(lost, 0.0, confidence)

    def _off_frame(self, shapes):
        corners = np.asarray(self.request.target.outlines(self.start_at, shapes), float)
        lowest, highest = corners.min(axis=1), corners.max(axis=1)
        size = np.array([self.source.width, self.source.height])
        inside = np.all((lowest < size) & (highest > 0), axis=1)
        return ~inside  # an outline of NaN compares false everywhere, so it counts as lost

    def _draw(self, tracked, found, lost):
        if not self._is_watched():
            return
        frame, summary = tracked.frame, tracked.summary
        frame = self.adapter.draw_particles(
            frame, self.start_at, self.filter, self.uncertainty.cloud(tracked.state), self.colours
        )
        confidence = getattr(summary, "confidence", None)
        self._show_objects(frame, found, lost, confidence, self.uncertainty.places(summary))

    def _show_objects(self, frame, found, lost, confidence=None, places=None):
        from jaxpf.media.overlay import draw_spreads

        if not self._is_watched():
            return
        self.past.append(found)
        past = np.stack(self.past)
        doubtful = None if confidence is None else confidence < PROBABLY_LOST
        marks = Marks(self.colours, lost, past, doubtful)
        picture = self.adapter.draw(frame, self.start_at, found, marks)
        if places is not None:
            picture = draw_spreads(picture, places[0], places[1], self.colours)
        self._show(picture)

    def _is_watched(self):
        """Whether a picture of this frame goes anywhere."""
        return self.video is not None or (self.window is not None and self.window.is_due)

    def _show(self, picture):
        if self.video is not None:
            self.video.write(picture)
        if self.window is not None and self.window.is_due:
            self.window.show(picture)

    def finish(self, stopped, truth):
        """Write what is known only at the end, and tell the user; ``stopped``: by what, or None."""
        from jaxpf.files.writing import write_text
        from jaxpf.media import plotting

        rate = (self.num_tracked - 1) / self.seconds_rest if self.seconds_rest > 0 else None
        content = {
            "parameters": {k: _jsonable(v) for k, v in self.request.table().items()},
            "likelihood_method": self._likelihood_method(),
            **self._content(),
            "frames_tracked": self.num_tracked,
            "interrupted": isinstance(stopped, KeyboardInterrupt),
            "error": str(stopped) if isinstance(stopped, InputError) else None,
            "video_truncated": self.source.truncated,
            "video_note": self.source.note,
            "remarks": list(self.start_at.remarks),
            "frames_outside": self.frames_outside,
            "frames_without_likelihood": self.frames_without_likelihood,
            "frames_probably_lost": self.frames_probably_lost,
            "mean_confidence": self._mean_confidence(),
            **self.uncertainty.means(self.ids),
            "impossible_frames": self.num_impossible,
            "invalid_likelihoods": self.num_invalid,
            "seconds_first_frame": round(self.seconds_first, 3),
            "seconds_other_frames": round(self.seconds_rest, 3),
            "frames_per_second": None if rate is None else round(rate, 2),
            "versions": versions(),
        }
        write_text(self.output / "summary.json", json.dumps(content, indent=2) + "\n")
        if self.num_tracked:
            table = np.loadtxt(self.output / "diagnostics.csv", delimiter=",", skiprows=1, ndmin=2)
            last = 3 + len(self.ids)
            figure = plotting.diagnostics(
                table[:, 0],
                table[:, 1],
                table[:, 3:last],
                table[:, 2],
                self.ids.tolist(),
                int(getattr(self.tracker, "num_particles", 0) or np.nanmax(table[:, 1], initial=1)),
                table[:, last:] if table.shape[1] > last else None,
            )
            plotting.save_figure(figure, self.output / "diagnostics.png")
        self._tell(rate)
        if truth is not None and self.num_tracked:
            self._report_truth(truth)
            if self.smoothed is not None:
                self._report_truth(truth, "smoothed")

    def _mean_confidence(self):
        """Of each object over the frames tracked; None where the likelihood cannot tell."""
        if self.total_confidence is None:
            return None
        mean = self.total_confidence / self.num_tracked
        return {str(name): round(float(m), 4) for name, m in zip(self.ids, mean, strict=True)}

    def _content(self):
        """What the summary says of the objects."""
        return {"ids": self.ids.tolist()}

    def _likelihood_method(self):
        """How the likelihood is computed, where it tells; else what was asked for."""
        if self.request.run.tracker:
            return None
        likelihood = getattr(self.filter.likelihood, "likelihood", self.filter.likelihood)
        return getattr(likelihood, "method", getattr(self.request.model, "likelihood", None))

    def _tell(self, rate):
        speed = "" if rate is None else f", {rate:.1f} frames/s"
        click.echo(f"{self.output}: {counted(self.num_tracked)} tracked{speed}")
        self.uncertainty.tell(self.ids)
        if self.source.note:
            click.echo(f"Note: {self.source.note}", err=True)
        unsure = f" (confidence below {PROBABLY_LOST:g})"
        for how, where, why, frames_of in (
            ("Lost", " was outside the picture", "", self.frames_outside),
            ("Lost", " had no likelihood for any particle", "", self.frames_without_likelihood),
            ("Probably lost", "", unsure, self.frames_probably_lost),
        ):
            for name, frames in frames_of.items():
                if frames:
                    click.echo(
                        f"{how}: object {name}{where} in {counted(len(frames))}, first in frame "
                        f"{frames[0]}{why}.",
                        err=True,
                    )
        if self.num_impossible:
            click.echo(
                f"Warning: {counted(self.num_impossible)} had no likelihood for any particle; "
                "what was seen there was left out.",
                err=True,
            )
        if self.num_invalid:
            click.echo(
                f"Warning: {self.num_invalid} likelihood(s) were not a number and counted as zero.",
                err=True,
            )

    def _report_truth(self, truth: Any, which: str = "") -> None:
        """Metrics over the frames after the start that have truth; also of smoothed tracks."""
        from jaxpf.cli.tracking.against_truth import report_truth

        first = self.request.run.start + self.before[1]
        report_truth(self.output, self.ids, first, truth, which)


def nothing_follows(source: Any, start: int) -> InputError:
    """The refusal of a video that ends with its start frame."""
    return InputError(
        f"no frame of '{source.path}' follows the start frame {start}, so there is nothing to "
        "track; give a longer video, or an earlier --start."
    )


def counted(count: int, noun: str = "frame") -> str:
    """``1 frame``, ``2 frames``."""
    return f"{count} {noun}{'' if count == 1 else 's'}"


def _jsonable(value: Any) -> Any:
    return str(value) if isinstance(value, Path) else value
