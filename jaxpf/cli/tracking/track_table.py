"""tracks.csv: one row per frame and object, for every kind of target."""

import array
import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from jaxpf.files.writing import LineWriter
from jaxpf.targets.target import Start, Target

if TYPE_CHECKING:
    from jaxpf.cli.tracking.records import Record, Scene

#: Percentages of the quantiles that bound a 95% interval.
LEVELS = (2.5, 97.5)
#: Maximum number of particles times objects sorted per frame; larger sets are thinned evenly.
_MOST_SORTED = 200_000


class Places(NamedTuple):
    """Positions of P objects in one frame, in the C columns of their kind.

    Attributes:
        values: ``[P, C]``, pixels and degrees.
        interval: ``[2, P, C]``, quantiles at ``LEVELS``; None if unknown.
        speed: ``[P]``, pixels per second; None in the first frame.
        speed_interval: ``[2, P]``; None if unknown.
        error: ``[P, 2]``, Monte-Carlo standard errors of x and y; None unless requested.
    """

    values: np.ndarray
    interval: np.ndarray | None = None
    speed: np.ndarray | None = None
    speed_interval: np.ndarray | None = None
    error: np.ndarray | None = None


class Tracks:
    """Writes tracks.csv, and outlines.csv for targets with outlines.

    The first filtered frame determines the header; the start frame's rows are delayed until then.
    """

    def __init__(
        self,
        output: Path,
        scene: "Scene",
        stack: contextlib.ExitStack,
        is_smoothed: bool = False,
    ):
        """Create the files; those of smoothed tracks say neither confidence nor who is lost."""
        names = ("tracks.csv", "outlines.csv")
        if is_smoothed:
            names = ("smoothed.csv", "smoothed_outlines.csv")
        tracks, outlines = (output / name for name in names)
        self._is_smoothed = is_smoothed
        self._file = stack.enter_context(LineWriter(tracks))
        outline_file = scene.target.outline_file(outlines, scene.start)
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
            moving = [group for group in record.groups if group.places.speed is not None]
            if not moving:
                return
            self._columns = self._header(moving[0])
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

    def _header(self, record: "Record") -> list[str]:
        places, names = record.places, [*self._target.columns]
        if places.interval is not None:
            varying = [name for name in names if name not in self._target.fixed_columns]
            names += [f"{name}_{level:g}" for name in varying for level in LEVELS]
        names.append("speed")
        if places.speed_interval is not None:
            names += [f"speed_{level:g}" for level in LEVELS]
        if not self._is_smoothed:
            names += [] if record.confidence is None else ["confidence"]
            names.append("lost")
        return names + ([] if places.error is None else ["x_error", "y_error"])

    def _rows(self, record: "Record") -> Iterator[list[Any]]:
        places = record.places
        cells: dict[str, Any] = {"speed": places.speed, "confidence": record.confidence}
        for column, name in enumerate(self._target.columns):
            cells[name] = places.values[:, column]
            for end, level in enumerate(LEVELS):
                if places.interval is not None:
                    cells[f"{name}_{level:g}"] = places.interval[end][:, column]
        for end, level in enumerate(LEVELS):
            if places.speed_interval is not None:
                cells[f"speed_{level:g}"] = places.speed_interval[end]
        if places.error is not None:
            cells |= {"x_error": places.error[:, 0], "y_error": places.error[:, 1]}
        unknown = np.full(len(record.start.ids), np.nan)
        given = (cells.get(name) for name in self._columns)
        table = [unknown if values is None else values for values in given]
        time = f"{self._shown_at(record.number):.4f}"
        for place in np.flatnonzero(np.isfinite(places.values).all(axis=1)):
            row = [
                str(int(record.lost[place])) if name == "lost" else _cell(name, values[place])
                for name, values in zip(self._columns, table, strict=True)
            ]
            yield [record.number, time, record.start.ids[place], *row]


def _cell(name: str, value: float) -> str:
    if np.isnan(value):
        return ""
    return f"{value:.6g}" if name in ("confidence", "x_error", "y_error") else f"{value:.3f}"


def places_of(
    scene: "Scene",
    number: int,
    start: Start,
    shapes: np.ndarray,
    state: Any = None,
    before: np.ndarray | None = None,
    slots: Any = slice(None),
) -> tuple[Places, np.ndarray]:
    """Values, intervals and speeds of one frame, and the centres ``[P, 2]`` for the next.

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
    before = np.full((len(shapes), 2), np.nan) if before is None else before
    substates = getattr(state, "substates", None)
    if substates is None:
        centres = centres_of(target, values)
        speed = np.linalg.norm(centres - before, axis=-1) / step
        return Places(values[slots], speed=speed[slots]), centres
    from jaxpf.filters import quantiles

    kept, weights = _kept(state)
    particles = target.column_values(start, scene.shapes(start, np.asarray(substates)[kept]))
    levels = [level / 100 for level in LEVELS]
    # Sort only the reported partitions.
    shown = weights if weights.ndim == 1 else weights[slots]
    interval = quantiles(particles[:, slots], shown, levels)
    error = scene.model_error(len(shapes))
    if error.any():
        interval = _widened(values[slots], interval, error[slots], target.has_boxes)
    middles = centres_of(target, particles)
    centres = _mean(middles, weights)
    moved = (centres - before) / step
    speed = np.linalg.norm(moved, axis=-1)
    places = Places(values[slots], interval, speed[slots])
    previous = getattr(state, "previous_substates", None)
    if previous is None:
        return places, centres
    earlier = target.column_values(start, scene.shapes(start, np.asarray(previous)[kept]))
    steps = (middles - centres_of(target, earlier)) / step
    # Deviation of each particle's step from the mean step, along the estimate's direction.
    along = np.sum((steps - _mean(steps, weights)) * moved, -1) / np.maximum(speed, 1e-9)
    ends = speed[slots] + quantiles(along[:, slots, None], shown, levels)[..., 0]
    return places._replace(speed_interval=np.maximum(ends, 0)), centres


def _widened(
    values: np.ndarray, interval: np.ndarray, error: np.ndarray, has_boxes: bool
) -> np.ndarray:
    """Add the model's error, independent and normal, to 95% intervals ``[2, P, C]``.

    Exact if the particles are normally distributed around the values.
    """

    def around(values: np.ndarray, interval: np.ndarray, deviation: Any) -> np.ndarray:
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
