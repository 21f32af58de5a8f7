"""The columns of tracks.csv: one row per frame and object, for every kind of target."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from jaxpf.contract import calls
from jaxpf.detections.records import Group
from jaxpf.files.writing import LineWriter
from jaxpf.filters import quantiles
from jaxpf.targets.building import shapes_of
from jaxpf.targets.target import Start, Target

#: Percentages of the quantiles that bound a 95% interval.
LEVELS = (2.5, 97.5)
#: Maximum number of particles times objects sorted per frame; larger sets are thinned evenly.
_MOST_SORTED = 200_000


class Columns:
    """The columns of each group; remembers centres, because speeds are steps between frames."""

    def __init__(self, target: Target, shown_at: Callable[[int], float]):
        self._target, self._shown_at = target, shown_at
        #: Frame in which a group started -> ids and centres of its partitions in the last frame.
        self._before: dict[int, tuple[np.ndarray, np.ndarray]] = {}

    def resume(self, since: int, tracker: Any, start: Start, state: Any) -> None:
        """Take the centres of the last frame of an earlier run from its state."""
        if hasattr(state, "substates") and not self._target.is_told_boxes_by(tracker):
            kept, weights = _kept(state)
            values = _values(self._target, tracker, start, np.asarray(state.substates)[kept])
            self._before[since] = start.ids, _mean(self._target.centres(values), weights)

    def __call__(self, number: int, group: Group) -> dict[str, np.ndarray]:
        """Columns of frame ``number``, ``[Q]`` each; only the coordinates where a group starts."""
        target, start, summary = self._target, group.start, group.summary
        unknown = np.full((len(start.ids), 2), np.nan)
        ids, before = self._before.get(group.since, (start.ids, unknown))
        before = np.where((start.ids == ids)[:, None], before, np.nan)
        step = self._shown_at(number) - self._shown_at(max(number - 1, 0))
        places, centres = places_of(target, group, before, step)
        self._before[group.since] = start.ids, centres
        if summary is None:
            return {name: places[name] for name in target.columns} | {"lost": group.lost}
        if group.confidence is not None:
            places["confidence"] = group.confidence
        places["lost"] = group.lost
        variance = getattr(summary, "estimate_variance", None)
        if variance is not None and target.has_places:
            errors = np.sqrt(variance)[group.slots]
            places |= {"x_mc_error": errors[:, 0], "y_mc_error": errors[:, 1]}
        return places


def places_of(
    target: Target, group: Group, before: np.ndarray, step: float
) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Places of a group in one frame, and the centres ``[P, 2]`` of its partitions for the next.

    Places are columns of tracks.csv, ``[Q]`` each: values in pixels and degrees, their quantiles at
    ``LEVELS``, those of a box's centre, the speed in pixels per second, and its quantiles.  A state
    without particles, or of a tracker that returns boxes of its own, has no intervals.

    Args:
        target: the kind of target.
        group: in this frame.
        before: ``[P, 2]``, centres in the previous frame; NaN if unknown.
        step: seconds since that frame.
    """
    start, slots, state = group.start, group.slots, group.state
    values = target.column_values(start, group.shapes)
    places = dict(zip(target.columns, values[slots].T, strict=True))
    if not hasattr(state, "substates") or target.is_told_boxes_by(group.tracker):
        centres = target.centres(values)
        speed = np.linalg.norm(centres - before, axis=-1) / step
        return places | {"speed": speed[slots]}, centres

    kept, weights = _kept(state)
    particles = _values(target, group.tracker, start, np.asarray(state.substates)[kept])
    levels = [level / 100 for level in LEVELS]
    # Sort only the reported partitions.
    shown = weights if weights.ndim == 1 else weights[slots]
    middles = target.centres(particles)
    centres = _mean(middles, weights)
    error = calls.model_error(group.tracker, len(start.ids))[slots]

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
        interval = interval_of(target.centres(values[slots]), middles, False)
        places |= _ends("centre_x", interval[..., 0]) | _ends("centre_y", interval[..., 1])
    places["speed"] = speed[slots]
    previous = getattr(state, "previous_substates", None)
    if previous is None:
        return places, centres
    earlier = _values(target, group.tracker, start, np.asarray(previous)[kept])
    steps = (middles - target.centres(earlier)) / step
    # Deviation of each particle's step from the mean step, along the estimate's direction.
    along = np.sum((steps - _mean(steps, weights)) * moved, -1) / np.maximum(speed, 1e-9)
    ends = speed[slots] + quantiles(along[:, slots, None], shown, levels)[..., 0]
    return places | _ends("speed", np.maximum(ends, 0)), centres


def _values(target: Target, tracker: Any, start: Start, substates: np.ndarray) -> np.ndarray:
    """Values of the columns ``[N, P, C]`` of particles ``[N, P, D]``."""
    shapes = shapes_of(tracker, target, start, substates)
    return target.column_values(start, np.asarray(shapes, float))


def _ends(name: str, interval: np.ndarray) -> dict[str, np.ndarray]:
    """The columns of an interval ``[2, Q]``."""
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


class TrackTable(LineWriter):
    """Writes tracks.csv; an object without a place has no row."""

    def __init__(self, path: Path, coordinates: Sequence[str], columns: Sequence[str]):
        super().__init__(path)
        self._coordinates, self._columns = coordinates, columns
        self.write_rows([["frame", "time", "id", *columns]])

    def add(
        self, number: int, time: float, *groups: tuple[np.ndarray, dict[str, np.ndarray]]
    ) -> None:
        """Write the rows of a frame, all or none.

        Args:
            number: of the frame.
            time: at which it is shown, seconds.
            groups: ids ``[Q]`` and columns, see ``Columns``.
        """
        rows = []
        for ids, columns in groups:
            there = np.isfinite([columns[name] for name in self._coordinates]).all(axis=0)
            for place in np.flatnonzero(there):
                given = (_cell(n, columns[n][place]) if n in columns else "" for n in self._columns)
                rows.append([number, f"{time:.4f}", ids[place], *given])
        self.write_rows(rows)


def _cell(name: str, value: float) -> str:
    if name == "lost":
        return f"{int(value)}"
    if np.isnan(value):
        return ""
    return f"{value:.6g}" if name in ("confidence", "x_mc_error", "y_mc_error") else f"{value:.3f}"
