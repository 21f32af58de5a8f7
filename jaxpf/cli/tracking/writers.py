"""Writers of a run: each receives every frame's record and keeps part of it."""

import collections
import contextlib
from collections.abc import Callable, Hashable, Sequence
from pathlib import Path

import numpy as np

from jaxpf.cli.tracking.records import Record, Scene
from jaxpf.cli.tracking.track_table import centres_of
from jaxpf.detections.lifetimes import EMPTY
from jaxpf.files.writing import LineWriter
from jaxpf.media.frame_source import FrameSource
from jaxpf.media.overlay import draw_spreads
from jaxpf.media.video_writer import VideoWriter
from jaxpf.targets.target import Marks

#: Length of a trail in frames.
_TRAIL = 20
#: Consecutive frames that confirm a recovered object.
_CONFIRMED_AFTER = 5

#: Receives the records of a run in order, and keeps its part of them.
Writer = Callable[[Record], None]


class Diagnostics:
    """Writes diagnostics.csv: effective sample size, log evidence, share of distinct
    particles, and confidence.

    Attributes:
        ess: effective sample sizes of the frames, rounded as in the file.
    """

    def __init__(self, output: Path, names: Sequence[object], stack: contextlib.ExitStack):
        self._file = stack.enter_context(LineWriter(output / "diagnostics.csv"))
        self._names, self._is_new = names, True
        self.ess: list[float] = []

    def __call__(self, record: Record) -> None:
        """Write a row; a user-defined tracker may report less than the built-in ones."""
        if not record.filtered:
            return
        columns = {"distinct_share": self._row(record, "distinct_share")}
        if any(group.confidence is not None for group in record.filtered):
            columns["confidence"] = self._row(record, "confidence")
        if self._is_new:
            names = [f"{column}_{name}" for column in columns for name in self._names]
            self._file.write_rows([["frame", "ess", "log_evidence", *names]])
            self._is_new = False
        scalars = [min(_reported(record, "ess")), sum(_reported(record, "log_evidence"))]
        values = [*scalars, *np.concatenate([*columns.values()])]
        cells = [f"{value:.6g}" for value in values]
        self._file.write_rows([[record.number, *cells]])
        self.ess.append(float(cells[0]))

    def _row(self, record: Record, name: str) -> np.ndarray:
        """A column of the summaries, by object; NaN where a group does not report it."""
        row = np.full(len(self._names), np.nan)
        for group in record.filtered:
            if (values := getattr(group.summary, name, None)) is None:
                continue
            values = np.array(values, float)
            if name == "confidence":
                values[group.slots] = group.confidence
            if not record.parts:
                return values
            columns = [self._names.index(each) for each in group.start.ids.tolist()]
            row[columns] = values[group.slots]
        return row


def _reported(record: Record, name: str, otherwise: float = np.nan) -> list[float]:
    """A number of each summary."""
    return [float(getattr(group.summary, name, otherwise)) for group in record.filtered]


class Overlay:
    """Writes overlay.mp4, whose frames have the times and the shape of pixels of the video's.

    A recovered object is drawn as doubtful until it has been tracked for ``_CONFIRMED_AFTER``
    frames.
    """

    def __init__(
        self, output: Path, scene: Scene, source: FrameSource, stack: contextlib.ExitStack
    ):
        self._scene = scene
        self._video = stack.enter_context(
            VideoWriter(output / "overlay.mp4", *scene.size, source.fps, source.pixel_aspect)
        )
        self._began: float | None = None
        self._past: collections.deque[np.ndarray] = collections.deque(maxlen=_TRAIL)
        self._unconfirmed: dict[Hashable, int] = {}

    def __call__(self, record: Record) -> None:
        """Draw a frame."""
        doubtful = self._doubtful(record)
        if record.changes is None:
            if self._past and len(self._past[-1]) != len(record.shapes):
                self._past.clear()  # an object has started
            self._past.append(record.shapes)
        time = self._scene.shown_at(record.number)
        self._began = time if self._began is None else self._began
        self._video.write(self._draw(record, doubtful), time - self._began)

    def _doubtful(self, record: Record) -> np.ndarray:
        """``[P]`` bool: the object was lost, and is recovered but not yet confirmed."""
        names = record.start.ids.tolist()
        for name, is_lost in zip(names, record.lost, strict=True):
            left = self._unconfirmed.get(name, 0) - 1
            self._unconfirmed[name] = _CONFIRMED_AFTER if is_lost else max(left, 0)
        return np.array([self._unconfirmed[name] > 0 for name in names], bool) & ~record.lost

    def _draw(self, record: Record, doubtful: np.ndarray) -> np.ndarray:
        target, frame = self._scene.target, record.frame
        for part in record.filtered:
            scene = part.scene or self._scene
            colours = np.zeros((len(part.summary.estimate), 3), np.uint8)
            colours[part.slots] = part.colours
            frame = target.draw_particles(frame, scene.start, scene.tracker, part.state, colours)
        past = np.stack(self._past) if self._past else None
        marks = Marks(record.colours, record.lost, past, doubtful)
        picture = target.draw(frame, record.start, record.shapes, marks)
        for part in record.filtered:
            scene, spread = part.scene or self._scene, getattr(part.summary, "spread", None)
            if spread is None or scene.has_own_boxes or not target.has_places:
                continue
            values = np.stack([part.places[name] for name in target.columns], axis=-1)
            centres = centres_of(target, values)
            spread = np.hypot(spread[:, :2], scene.model_error(len(spread))[:, :2])[part.slots]
            picture = draw_spreads(picture, centres, spread, part.colours)
        return picture


class Population:
    """Collects starts, ends and refusals for the summary."""

    def __init__(self) -> None:
        self.started: list[dict] = []
        self.ended: list[dict] = []
        self.refused: list[dict] = []

    def __call__(self, record: Record) -> None:
        """Collect the changes of a frame."""
        number, changes = record.number, record.changes
        assert changes is not None
        for new in changes.started:
            self.started.append({"id": new.id, "frame": number, "box": new.box.tolist()})
        for gone in changes.ended:
            self.ended.append({"id": gone.id, "frame": number, "reason": gone.reason})
        for refusal in changes.refused:
            name = None if refusal.id == EMPTY else refusal.id
            box, reason = refusal.box.tolist(), refusal.reason
            self.refused.append({"id": name, "frame": number, "box": box, "reason": reason})


class Counts:
    """Counts frames, likelihood failures, and frames with lost objects."""

    def __init__(self, ids: Sequence[object] | np.ndarray):
        self.tracked = self.invalid = self.impossible = self.last = 0
        self.outside: dict[str, list[int]] = {str(name): [] for name in ids}
        self.without_likelihood: dict[str, list[int]] = {str(name): [] for name in ids}

    def __call__(self, record: Record) -> None:
        """Count a frame; ``last`` is its number, also where objects only start again."""
        self.last = record.number
        if not record.filtered:
            return
        self.tracked += 1
        self.invalid += int(sum(_reported(record, "num_invalid", 0)))
        self.impossible += int(np.isneginf(sum(_reported(record, "log_evidence"))))
        for group in record.filtered:
            for where, frames in (
                (group.outside, self.outside),
                (group.without_likelihood, self.without_likelihood),
            ):
                for name in group.start.ids[where]:
                    frames.setdefault(str(name), []).append(record.number)
