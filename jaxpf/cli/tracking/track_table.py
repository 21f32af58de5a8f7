"""tracks.csv: one row per frame and object, for every kind of target."""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jaxpf.files.writing import LineWriter

#: Percentages of the quantiles that bound a 95 % interval.
LEVELS = (2.5, 97.5)
#: At most this many particles and objects are sorted per frame; of more, an even selection.
_MOST_SORTED = 200_000


class Places(NamedTuple):
    """Where P objects are in one frame, in the C columns of their kind.

    Attributes:
        values: ``[P, C]``, pixels and degrees.
        interval: ``[2, P, C]``, quantiles at ``LEVELS``; None if unknown.
        speed: ``[P]``, pixels per second; None in the first frame.
        speed_interval: ``[2, P]``; None if unknown.
        error: ``[P, 2]``, Monte-Carlo standard errors of x and y; None unless requested.
    """

    values: np.ndarray
    interval: Any = None
    speed: Any = None
    speed_interval: Any = None
    error: Any = None


class TrackTable(LineWriter):
    """Writes tracks.csv; its header follows from the first frame that is filtered."""

    def __init__(self, path: Path, adapter: Any, fps: float):
        """Create the file for a kind of target."""
        super().__init__(path)
        self._adapter, self._fps = adapter, fps
        self._waiting: list[tuple[int, Any, Places, Any, Any]] = []
        self._columns: list[str] = []

    def write(
        self, number: int, ids: Any, places: Places, lost: Any, confidence: Any = None
    ) -> None:
        """Append the rows of one frame; the start frame waits for the one after it.

        Args:
            number: of the frame, from 0.
            ids: ``[P]``.
            places: where the objects are.
            lost: bool ``[P]``.
            confidence: ``[P]``, or None if the likelihood has none.
        """
        self._waiting.append((number, ids, places, lost, confidence))
        if not self._columns and places.speed is None:
            return
        if not self._columns:
            self._columns = self._header(places, confidence)
            self.write_rows([["frame", "time", "id", *self._columns]])
        for frame in self._waiting:
            self.write_rows(self._rows(*frame))
        self._waiting.clear()

    def _header(self, places: Places, confidence: Any) -> list[str]:
        names = [*self._adapter.columns]
        if places.interval is not None:
            varying = [name for name in names if name not in self._adapter.fixed_columns]
            names += [f"{name}_{level:g}" for name in varying for level in LEVELS]
        names.append("speed")
        if places.speed_interval is not None:
            names += [f"speed_{level:g}" for level in LEVELS]
        if confidence is not None:
            names.append("confidence")
        names.append("lost")
        return names + ([] if places.error is None else ["x_error", "y_error"])

    def _rows(self, number: int, ids: Any, places: Places, lost: Any, confidence: Any) -> Any:
        count = len(ids)
        cells: dict[str, Any] = {"speed": places.speed, "confidence": confidence}
        for column, name in enumerate(self._adapter.columns):
            cells[name] = places.values[:, column]
            for end, level in enumerate(LEVELS):
                if places.interval is not None:
                    cells[f"{name}_{level:g}"] = places.interval[end][:, column]
        for end, level in enumerate(LEVELS):
            if places.speed_interval is not None:
                cells[f"speed_{level:g}"] = places.speed_interval[end]
        if places.error is not None:
            cells |= {"x_error": places.error[:, 0], "y_error": places.error[:, 1]}
        unknown = np.full(count, np.nan)
        table = [cells.get(name) for name in self._columns]
        table = [unknown if values is None else values for values in table]
        for place in np.flatnonzero(np.isfinite(places.values).all(axis=1)):
            row = [
                str(int(lost[place])) if name == "lost" else _cell(name, values[place])
                for name, values in zip(self._columns, table, strict=True)
            ]
            yield [number, f"{number / self._fps:.4f}", ids[place], *row]


def _cell(name: str, value: float) -> str:
    if np.isnan(value):
        return ""
    return f"{value:.6g}" if name in ("confidence", "x_error", "y_error") else f"{value:.3f}"


def places_of(
    adapter: Any,
    start: Any,
    to_shapes: Any,
    shapes: np.ndarray,
    state: Any,
    slots: Any,
    fps: float,
    before: np.ndarray | None,
) -> Places:
    """Values, intervals and speeds of one frame.

    Args:
        adapter: of the kind of target.
        start: of all partitions.
        to_shapes: function from substates ``[N, P, D]`` to shapes ``[N, P, S]``.
        shapes: the estimate's ``[P, S]``, NaN for a partition without an object.
        state: holds the weighted particles; one without ``substates`` has no intervals.
        slots: the partitions to report.
        fps: frames per second.
        before: ``[P, 2]``, centres one frame earlier; None in the first frame.
    """
    values = adapter.column_values(start, shapes)
    speed = np.full(len(shapes), np.nan)
    if before is not None:
        speed = fps * np.linalg.norm(_centres(adapter, values) - before, axis=-1)
    substates = getattr(state, "substates", None)
    if substates is None:
        return Places(values[slots], speed=speed[slots])
    from jaxpf.filters import quantiles

    count = substates.shape[0]
    kept = np.unique(
        np.linspace(0, count - 1, min(count, _MOST_SORTED // max(len(shapes), 1))).astype(int)
    )
    weights = np.asarray(state.log_weights)[..., kept]
    particles = adapter.column_values(start, to_shapes(np.asarray(substates)[kept]))
    low, high = LEVELS[0] / 100, LEVELS[1] / 100
    interval = quantiles(particles, weights, [low, high])[:, slots]
    previous = getattr(state, "previous_substates", None)
    if previous is None:
        return Places(values[slots], interval, speed[slots])
    earlier = adapter.column_values(start, to_shapes(np.asarray(previous)[kept]))
    moved = fps * (_centres(adapter, particles) - _centres(adapter, earlier))
    speed, along = _speeds(moved, np.exp(weights))
    return Places(
        values[slots],
        interval,
        speed[slots],
        np.maximum(quantiles(along[..., None], weights, [low, high])[:, slots, 0], 0),
    )


def _speeds(velocities: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The mean velocity's length ``[P]``, and each particle's velocity along it ``[N, P]``.

    The length of each particle's velocity would add its noise to the speed.

    Args:
        velocities: ``[N, P, 2]``.
        weights: ``[N]`` or ``[P, N]``.
    """
    weights = weights[:, None] if weights.ndim == 1 else weights.T
    held = np.isfinite(velocities).all(axis=-1)
    weights = np.where(held, weights, 0.0)
    total = np.maximum(weights.sum(axis=0), 1e-300)
    mean = np.sum(np.where(held[..., None], velocities, 0) * weights[..., None], 0) / total[:, None]
    speed = np.linalg.norm(mean, axis=-1)
    along = np.sum(velocities * (mean / np.maximum(speed, 1e-9)[:, None]), axis=-1)
    return np.where(held.any(axis=0), speed, np.nan), along


def _centres(adapter: Any, values: np.ndarray) -> np.ndarray:
    """x and y of the middle: ``[..., 2]``."""
    corner = values[..., :2]
    return corner + values[..., 2:4] / 2 if adapter.target.has_boxes else corner


def centres_of(adapter: Any, start: Any, shapes: np.ndarray) -> np.ndarray:
    """x and y of the middle of shapes ``[P, S]``: ``[P, 2]``."""
    return _centres(adapter, adapter.column_values(start, shapes))
