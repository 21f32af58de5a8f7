"""tracks.csv: one row per frame and object, for every kind of target."""

import array
import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jaxpf.files.writing import LineWriter
from jaxpf.filters import quantiles
from jaxpf.targets.target import Start, Target

if TYPE_CHECKING:
    from jaxpf.cli.tracking.records import Record, Scene

#: Percentages of the quantiles that bound a 95% interval.
LEVELS = (2.5, 97.5)
#: Maximum number of particles times objects sorted per frame; larger sets are thinned evenly.
_MOST_SORTED = 200_000


class Tracks:
    """Writes tracks.csv, and outlines.csv for targets with outlines.

    The first filtered frame determines the header; the start frame's rows are delayed until then.
    """

    def __init__(
        self,
        output: Path,
        scene: "Scene",
        stack: contextlib.ExitStack,
    ):
        """Create the files."""
        self._file = stack.enter_context(LineWriter(output / "tracks.csv"))
        outline_file = scene.target.outline_file(output / "outlines.csv", scene.start)
        self._write_outlines = stack.enter_context(outline_file)
        self._target, self._shown_at = scene.target, scene.shown_at
        self._waiting: list[Record] = []
        self._columns: list[str] = []
        self._ids: list[Any] = []
        self._numbers = array.array("d")

    def __call__(self, record: "Record") -> None:
        """Write the rows of a frame."""
        if self._write_outlines is not None:
            self._write_outlines(record.number, record.shapes)
        self._waiting += record.groups
        if not self._columns:
            moving = [group for group in record.groups if "speed" in group.places]
            if not moving:
                return
            self._columns = list(self._cells(moving[0]))
            self._file.write_rows([["frame", "time", "id", *self._columns]])
        rows = [row for each in self._waiting for row in self._rows(each)]
        self._file.write_rows(rows)
        for frame, time, name, *cells in rows:
            self._ids.append(name)
            self._numbers.extend([frame, float(time), *(float(cell or "nan") for cell in cells)])
        self._waiting.clear()

    @property
    def table(self) -> dict[str, np.ndarray]:
        """The columns written so far, rounded as in the file; see ``jaxpf.boxes.read_tracks``."""
        names = ["frame", "time", *self._columns]
        table = dict(zip(names, np.reshape(self._numbers, (-1, len(names))).T, strict=True))
        return table | {"frame": table["frame"].astype(int), "id": np.array(self._ids)}

    def _cells(self, record: "Record") -> dict[str, np.ndarray]:
        """The columns of a record, ``[P]`` each."""
        sure = {} if record.confidence is None else {"confidence": record.confidence}
        return {**record.places, **sure, "lost": record.lost, **record.errors}

    def _rows(self, record: "Record") -> Iterator[list[Any]]:
        cells, time = self._cells(record), f"{self._shown_at(record.number):.4f}"
        there = np.isfinite([cells[name] for name in self._target.columns]).all(axis=0)
        for place in np.flatnonzero(there):
            row = [
                _cell(name, cells[name][place]) if name in cells else "" for name in self._columns
            ]
            yield [record.number, time, record.start.ids[place], *row]


def _cell(name: str, value: float) -> str:
    if name == "lost":
        return f"{int(value)}"
    if np.isnan(value):
        return ""
    return f"{value:.6g}" if name in ("confidence", "x_mc_error", "y_mc_error") else f"{value:.3f}"


def places_of(
    scene: "Scene",
    number: int,
    start: Start,
    shapes: np.ndarray,
    state: Any = None,
    before: np.ndarray | None = None,
    slots: np.ndarray | slice = slice(None),
) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Places of one frame, and the centres ``[P, 2]`` for the next.

    Places are columns of tracks.csv, ``[P]`` each: values in pixels and degrees, their quantiles at
    ``LEVELS``, those of a box's centre, the speed in pixels per second, and its quantiles.

    Args:
        scene: settings of the run.
        number: of the frame.
        start: start of all partitions.
        shapes: ``[P, S]``, the estimate, NaN for a partition without an object.
        state: holds the weighted particles; a state without ``substates`` has no intervals.
        before: ``[P, 2]``, centres in the previous frame; None if unknown.
        slots: partitions to report.
    """
    target, step = scene.target, np.nan
    if number > scene.first:
        step = scene.shown_at(number) - scene.shown_at(number - 1)
    values = target.column_values(start, shapes)
    places = dict(zip(target.columns, values[slots].T, strict=True))
    before = np.full((len(shapes), 2), np.nan) if before is None else before
    substates = getattr(state, "substates", None)
    if substates is None:
        centres = centres_of(target, values)
        speed = np.linalg.norm(centres - before, axis=-1) / step
        return places | {"speed": speed[slots]}, centres
    kept, weights = _kept(state)
    particles = target.column_values(start, scene.shapes(start, np.asarray(substates)[kept]))
    levels = [level / 100 for level in LEVELS]
    # Sort only the reported partitions.
    shown = weights if weights.ndim == 1 else weights[slots]
    middles = centres_of(target, particles)
    centres = _mean(middles, weights)
    error = scene.model_error(len(shapes))[slots]

    def interval_of(values: np.ndarray, particles: np.ndarray, has_boxes: bool) -> np.ndarray:
        interval = quantiles(particles[:, slots], shown, levels)
        return _widened(values, interval, error, has_boxes) if error.any() else interval

    interval = interval_of(values[slots], particles, target.has_boxes)
    moved = (centres - before) / step
    speed = np.linalg.norm(moved, axis=-1)
    for column, name in enumerate(target.columns):
        if name not in target.fixed_columns:
            places |= _ends(name, interval[..., column])
    if target.has_boxes:  # x, y is a corner
        interval = interval_of(centres_of(target, values[slots]), middles, False)
        places |= _ends("centre_x", interval[..., 0]) | _ends("centre_y", interval[..., 1])
    places["speed"] = speed[slots]
    previous = getattr(state, "previous_substates", None)
    if previous is None:
        return places, centres
    earlier = target.column_values(start, scene.shapes(start, np.asarray(previous)[kept]))
    steps = (middles - centres_of(target, earlier)) / step
    # Deviation of each particle's step from the mean step, along the estimate's direction.
    along = np.sum((steps - _mean(steps, weights)) * moved, -1) / np.maximum(speed, 1e-9)
    ends = speed[slots] + quantiles(along[:, slots, None], shown, levels)[..., 0]
    return places | _ends("speed", np.maximum(ends, 0)), centres


def _ends(name: str, interval: np.ndarray) -> dict[str, np.ndarray]:
    """The columns of an interval ``[2, P]``."""
    return {f"{name}_{level:g}": end for level, end in zip(LEVELS, interval, strict=True)}


def _widened(
    values: np.ndarray, interval: np.ndarray, error: np.ndarray, has_boxes: bool
) -> np.ndarray:
    """Add the model's error, independent and normal, to 95% intervals ``[2, P, C]``.

    Exact if the particles are normally distributed around the values.
    """

    def around(values: np.ndarray, interval: np.ndarray, deviation: np.ndarray) -> np.ndarray:
        reach = np.hypot(interval - values, 1.96 * deviation)
        return np.stack([values - reach[0], values + reach[1]])

    place, rest = error[:, :2], interval[..., 2:]
    if has_boxes:  # x, y is a corner, and moves with the size
        extent = values[:, 2:]
        place = np.hypot(place, error[:, 2:] * extent / 2)
        rest = np.exp(around(np.log(extent), np.log(rest), error[:, 2:]))
    return np.concatenate([around(values[:, :2], interval[..., :2], place), rest], axis=-1)


def _kept(state: Any) -> tuple[np.ndarray, np.ndarray]:
    """Indices of the particles to sort, and their log-weights ``[N]`` or ``[P, N]``."""
    count, num_partitions = state.substates.shape[:2]
    most = min(count, _MOST_SORTED // max(num_partitions, 1))
    kept = np.unique(np.linspace(0, count - 1, most).astype(int))
    return kept, np.asarray(state.log_weights)[..., kept]


def _mean(values: np.ndarray, log_weights: np.ndarray) -> np.ndarray:
    """Weighted means ``[P, C]`` of ``[N, P, C]``; NaN for a partition without particles."""
    weights = np.exp(np.asarray(log_weights, np.float64))
    weights = weights[:, None] if weights.ndim == 1 else weights.T
    held = np.isfinite(values).all(axis=-1)
    weights = np.where(held, weights, 0.0)[..., None]
    total = weights.sum(axis=0)
    sums = np.sum(np.where(held[..., None], values, 0) * weights, axis=0)
    return np.where(total > 0, sums / np.maximum(total, 1e-300), np.nan)


def centres_of(target: Target, values: np.ndarray) -> np.ndarray:
    """x and y of the centre: ``[..., 2]``."""
    corner = values[..., :2]
    return corner + values[..., 2:4] / 2 if target.has_boxes else corner
