"""Matplotlib figures, drawn without a display."""

import contextlib
import os
import warnings
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from jaxpf.files.writing import atomic_write
from jaxpf.media.overlay import object_colours

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Approximate gamma of sRGB, and the weights of its primaries in the luminance (white is 1).
_GAMMA = 2.2
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
#: Maximum luminance of lines on white, for a contrast of 2: (1 + .05) / (_LIGHTEST + .05).
_LIGHTEST = 0.475


def new_figure(
    rows: int = 1, columns: int = 1, share_x: bool = False, **options: Any
) -> "tuple[Figure, Any]":
    """Create a figure for a file, not a window; return it and its axes ``[rows, columns]``."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(layout="constrained", **options)
    FigureCanvasAgg(figure)
    return figure, figure.subplots(rows, columns, squeeze=False, sharex=share_x)


def save_figure(figure: "Figure", path: str | os.PathLike[str]) -> None:
    """Write a figure as a PNG file, completely or not at all."""
    with atomic_write(path, "wb") as file, _names_as_they_are(figure):
        figure.savefig(file, dpi=120, format="png")


@contextlib.contextmanager
def _names_as_they_are(figure: "Figure") -> Iterator[None]:
    """Save a figure whose titles and legends hold users' names: no formulas, no missing glyphs."""
    for axis in figure.axes:
        legends = [axis.get_legend(), *figure.legends]
        texts = [text for each in legends if each is not None for text in each.get_texts()]
        for text in (axis.title, *texts):
            text.set_parse_math(False)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing", UserWarning)
        yield


def _legend_name(name: str) -> str:
    """An object's name in a legend; matplotlib hides names that start with an underscore."""
    return f" {name}" if name.startswith("_") else name


def colours(count: int) -> list[tuple[float, ...]]:
    """Return the overlay's colours for matplotlib, so that overlays and plots agree.

    Colours too light for white paper, such as yellow, are darkened.
    """
    linear = (object_colours(count) / 255.0) ** _GAMMA
    luminance = linear @ _LUMINANCE
    darkened = linear * np.minimum(1, _LIGHTEST / luminance)[:, None]
    return [tuple(rgb) for rgb in (darkened ** (1 / _GAMMA)).tolist()]


#: Maximum number of objects in one figure of trajectories.
_MOST_OBJECTS = 8


def trajectories(
    table: Mapping[str, np.ndarray],
    columns: Sequence[str],
    lost: Mapping[str, Sequence[Sequence[int]]],
) -> "Figure":
    """Plot coordinates and speed over time with 95% intervals; shade frames of lost objects.

    Args:
        table: columns of tracks.csv, see ``jaxpf.boxes.read_tracks``.
        columns: the coordinates to draw.
        lost: id -> first and last frames of each stretch in which it was lost.
    """
    names = np.array([str(name) for name in table["id"].tolist()])
    shown = list(dict.fromkeys(names.tolist()))[:_MOST_OBJECTS]
    panels = [*columns, "speed"]
    figure, axes = new_figure(len(panels), 1, figsize=(9, 1 + 2 * len(panels)), share_x=True)
    for axis, column in zip(axes[:, 0], panels, strict=True):
        for name, colour in zip(shown, colours(len(shown)), strict=True):
            rows = names == name
            frame, value = table["frame"][rows], table[column][rows]
            axis.plot(frame, value, color=colour, linewidth=1.2, label=_legend_name(name))
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
    axes[0, 0].set_title(f"Bands: 95% intervals.  Shaded: lost{note}.", fontsize="small")
    axes[-1, 0].set(xlabel="frame")
    return figure
