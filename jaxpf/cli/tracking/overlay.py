"""overlay.mp4: the objects, their particles and their uncertainty drawn on the frames."""

import collections
from collections.abc import Hashable, Sequence
from pathlib import Path

import numpy as np

from jaxpf.contract import calls
from jaxpf.detections.records import Record
from jaxpf.media.film import FrameSource
from jaxpf.media.overlay import NUM_COLOURS, draw_spreads, object_colours
from jaxpf.media.video_writer import VideoWriter
from jaxpf.targets.target import Marks, Target

#: Length of a trail in frames.
_TRAIL = 20
#: Consecutive frames that confirm a recovered object.
_CONFIRMED_AFTER = 5


class Overlay:
    """Draws frames, whose times and shape of pixels are those of the film's.

    A recovered object is drawn as doubtful until it has been tracked for ``_CONFIRMED_AFTER``
    frames.
    """

    def __init__(self, path: Path, target: Target, source: FrameSource):
        size = source.width, source.height
        self.video = VideoWriter(path, *size, source.fps, source.pixel_aspect)
        self._target, self._shown_at = target, source.shown_at
        self._began: float | None = None
        self._past: collections.deque[np.ndarray] = collections.deque(maxlen=_TRAIL)
        self._unconfirmed: dict[Hashable, int] = {}
        self._rank: dict[Hashable, int] = {}

    def write(self, record: Record, columns: Sequence[dict[str, np.ndarray]]) -> None:
        """Draw a frame; ``columns`` are those of the record's groups."""
        past = None
        if record.changes is None:
            if self._past and len(self._past[-1]) != len(record.shapes):
                self._past.clear()  # an object has started
            self._past.append(record.shapes)
            past = np.stack(self._past)
        picture = record.frame
        for group in record.filtered:
            colours = np.zeros((len(group.summary.estimate), 3), np.uint8)
            colours[group.slots] = self._colours(group.ids, record)
            picture = self._target.draw_particles(
                picture, group.start, group.tracker, group.state, colours
            )
        marks = Marks(
            self._colours(record.ids, record), record.lost, past, self._is_doubtful(record)
        )
        picture = self._target.draw(picture, record.start, record.shapes, marks)
        for group, places in zip(record.groups, columns, strict=True):
            spread = getattr(group.summary, "spread", None)
            own = self._target.is_told_boxes_by(group.tracker)
            if spread is None or own or not self._target.has_places:
                continue
            values = np.stack([places[name] for name in self._target.columns], axis=-1)
            error = calls.model_error(group.tracker, len(spread))
            spread = np.hypot(spread[:, :2], error[:, :2])[group.slots]
            centres = self._target.centres(values)
            picture = draw_spreads(picture, centres, spread, self._colours(group.ids, record))
        time = self._shown_at(record.number)
        self._began = time if self._began is None else self._began
        self.video.write(picture, time - self._began)

    def _colours(self, ids: np.ndarray, record: Record) -> np.ndarray:
        """Colours ``[Q, 3]`` in the order in which objects start; of detected ones, by their id."""
        if record.changes is None:
            ids = np.array([self._rank.setdefault(n, len(self._rank)) for n in ids.tolist()], int)
        return object_colours(NUM_COLOURS)[ids % NUM_COLOURS]

    def _is_doubtful(self, record: Record) -> np.ndarray:
        """``[Q]`` bool: the object was lost, and is recovered but not yet confirmed."""
        names = record.ids.tolist()
        for name, is_lost in zip(names, record.lost, strict=True):
            left = self._unconfirmed.get(name, 0) - 1
            self._unconfirmed[name] = _CONFIRMED_AFTER if is_lost else max(left, 0)
        return np.array([self._unconfirmed[name] > 0 for name in names], bool) & ~record.lost
