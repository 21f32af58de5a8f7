"""Matplotlib figures, drawn without a display."""

import os
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from jaxpf.contract.names import PROBABLY_LOST
from jaxpf.contract.numbers import check_array, check_whole
from jaxpf.files.writing import atomic_write
from jaxpf.media.overlay import object_colours

#: Largest number of rows or columns of a figure.
_MOST_AXES = 1000
#: Approximate gamma of sRGB, and the weights of its primaries in the luminance (white is 1).
_GAMMA = 2.2
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
#: Maximum luminance of lines on white, for a contrast of 2: (1 + .05) / (_LIGHTEST + .05).
_LIGHTEST = 0.475


def new_figure(
    rows: int = 1, columns: int = 1, share_x: bool = False, **options: Any
) -> tuple[Any, Any]:
    """Create a figure for a file, not a window; return it and its axes ``[rows, columns]``."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    check_whole("rows", rows, most=_MOST_AXES)
    check_whole("columns", columns, most=_MOST_AXES)
    figure = Figure(layout="constrained", **options)
    FigureCanvasAgg(figure)
    return figure, figure.subplots(rows, columns, squeeze=False, sharex=share_x)


def save_figure(figure: Any, path: str | os.PathLike[str], dpi: int = 120) -> None:
    """Write a figure as a PNG file, completely or not at all."""
    check_whole("dpi", dpi, most=10_000)
    with atomic_write(path, "wb") as file:
        figure.savefig(file, dpi=dpi, format="png")


def colours(count: int) -> list[tuple[float, ...]]:
    """Return the overlay's colours for matplotlib, so that overlays and plots agree.

    Colours too light for white paper, such as yellow, are darkened.
    """
    linear = (object_colours(count) / 255.0) ** _GAMMA
    luminance = linear @ _LUMINANCE
    darkened = linear * np.minimum(1, _LIGHTEST / luminance)[:, None]
    return [tuple(rgb) for rgb in (darkened ** (1 / _GAMMA)).tolist()]


def diagnostics(
    frames: np.ndarray,
    ess: np.ndarray,
    uniqueness: np.ndarray,
    log_evidence: np.ndarray,
    ids: Sequence[Any],
    num_particles: int,
    confidence: np.ndarray | None = None,
) -> Any:
    """Plot effective sample size, evidence, and each object's uniqueness and confidence over time.

    Args:
        frames: frame numbers ``[T]``.
        ess: ``[T]``.
        uniqueness: ``[T, P]``.
        log_evidence: increments ``[T]``; ``-inf`` is marked, not drawn; no panel if all are NaN.
        ids: the objects' names ``[P]``.
        num_particles: N.
        confidence: ``[T, P]``, or None if the likelihood has none.
    """
    shape = f"one for every frame, [{len(frames)}]"
    of_objects = f"one for every frame and object, [{len(frames)}, {len(ids)}]"
    check_array("ess", ess, shape)
    check_array("log_evidence", log_evidence, shape)
    check_array("uniqueness", uniqueness, of_objects)
    if confidence is not None:
        check_array("confidence", confidence, of_objects)
    has_evidence = not np.isnan(log_evidence).all()
    rows = 2 + (confidence is not None) + has_evidence
    figure, axes = new_figure(rows, 1, figsize=(9, 2 + 2 * rows), share_x=True)
    upper, middle, *between = axes[:, 0]
    lower = between.pop() if has_evidence else None
    upper.plot(frames, ess, color="black")
    upper.set(ylabel=f"effective sample size\n(of {num_particles})", ylim=(0, None))
    for column, (name, colour) in enumerate(zip(ids, colours(len(ids)), strict=True)):
        label = name if isinstance(name, str) else f"object {name}"
        middle.plot(frames, 100 * uniqueness[:, column], color=colour, label=label)
    middle.set(ylabel="uniqueness (%)", ylim=(0, 102))
    middle.legend(ncols=min(len(ids), 7), fontsize="small", loc="upper right")
    for axis in between:
        for column, colour in enumerate(colours(len(ids))):
            axis.plot(frames, np.asarray(confidence)[:, column], color=colour)
        axis.axhline(PROBABLY_LOST, color="black", linestyle="dotted")
        axis.set(ylabel="confidence", ylim=(-0.02, 1.02))
    if lower is not None:
        possible = np.isfinite(log_evidence)
        lower.plot(frames[possible], log_evidence[possible], color="black")
        for frame in frames[~possible]:
            lower.axvline(frame, color="red", alpha=0.5)
        lower.set(ylabel="log evidence of the frame")
    axes[-1, 0].set(xlabel="frame")
    for axis in axes[:, 0]:
        axis.grid(alpha=0.3)
    return figure


#: Maximum number of objects in one figure of trajectories.
_MOST_OBJECTS = 8


def trajectories(
    table: Mapping[str, np.ndarray],
    columns: Sequence[str],
    lost: Mapping[str, Sequence[Sequence[int]]],
) -> Any:
    """Plot coordinates and speed over time with 95 % intervals; shade frames of lost objects.

    Args:
        table: columns of tracks.csv, see ``jaxpf.boxes.read_tracks``.
        columns: the coordinates to draw.
        lost: id -> first and last frames of the intervals in which it was probably lost.
    """
    names = np.array([str(name) for name in table["id"].tolist()])
    shown = list(dict.fromkeys(names.tolist()))[:_MOST_OBJECTS]
    panels = [*columns, "speed"]
    figure, axes = new_figure(len(panels), 1, figsize=(9, 1 + 2 * len(panels)), share_x=True)
    for axis, column in zip(axes[:, 0], panels, strict=True):
        for name, colour in zip(shown, colours(len(shown)), strict=True):
            rows = names == name
            frame, value = table["frame"][rows], table[column][rows]
            axis.plot(frame, value, color=colour, linewidth=1.2, label=name)
            if f"{column}_2.5" in table:
                low, high = (table[f"{column}_{level}"][rows] for level in ("2.5", "97.5"))
                axis.fill_between(frame, low, high, color=colour, alpha=0.25, linewidth=0)
            for first, last in lost.get(name, ()):
                axis.axvspan(first - 0.5, last + 0.5, color=colour, alpha=0.12, linewidth=0)
        unit = {"angle": "degrees", "speed": "pixels/s"}.get(column, "pixels")
        axis.set(ylabel=f"{column} ({unit})")
        axis.grid(alpha=0.3)
    if shown:
        axes[0, 0].legend(ncols=min(len(shown), 7), fontsize="small", loc="upper right")
    note = "" if len(shown) == len(set(names.tolist())) else f", the first {len(shown)} objects"
    axes[0, 0].set_title(f"Bands: 95 % intervals.  Shaded: probably lost{note}.", fontsize="small")
    axes[-1, 0].set(xlabel="frame")
    return figure


def bars_with_intervals(
    axis: Any, values: Mapping[str, tuple[float, float, float]], ylabel: str
) -> None:
    """Draw bars with asymmetric intervals: name -> (value, low, high)."""
    names = list(values)
    heights = np.array([values[name][0] for name in names])
    low = np.array([values[name][1] for name in names])
    high = np.array([values[name][2] for name in names])
    # Rounding may put a bound slightly on the wrong side of the value.
    errors = np.clip(np.stack([heights - low, high - heights]), 0, None)
    axis.bar(names, heights, yerr=errors, color=colours(len(names)), capsize=4)
    axis.set_ylabel(ylabel)
    axis.grid(axis="y", alpha=0.3)
