"""The figures of an evaluation, with captions, as PNG files reproducible byte for byte."""

import base64
import os
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from matplotlib import rc_context
from matplotlib.rcsetup import cycler
from matplotlib.ticker import LogLocator, NullLocator

from jaxpf.evaluation.estimates import ALL
from jaxpf.evaluation.measures import CURVES, DISTANCE, by_name
from jaxpf.evaluation.summaries import Overview
from jaxpf.evaluation.tables import heading_of, intervals
from jaxpf.files.writing import atomic_write, remove_leavings, report_os_errors
from jaxpf.measures.calibration import Reliability
from jaxpf.media.plotting import new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Drawing
    from numpy.typing import ArrayLike

#: Okabe and Ito (2008): the colours visible on white, most distinct first.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
#: Most configurations in the figures, the best ones.
MOST_LINES = 8
_STYLE: dict[Any, Any] = {
    "text.parse_math": False,  # names may contain dollar signs
    "font.size": 8.5,
    "axes.titlesize": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.alpha": 0.3,
}


class Figure(NamedTuple):
    """A saved figure.

    Attributes:
        data: the PNG file as text, for a page that needs no other file.
        width: in CSS pixels.
        height: in CSS pixels.
    """

    data: str
    width: int
    height: int


def write_figures(overview: Overview) -> dict[str, Figure]:
    """Write all figures, ``NAME.png``, into the folder ``figures`` of the evaluation.

    Raises:
        InputError: a file cannot be written.
    """
    folder = overview.results.folder / "figures"
    with report_os_errors("create the folder", folder):
        folder.mkdir(exist_ok=True)
    remove_leavings(folder)
    written = {}
    with in_style():
        for name, drawn in _drawn(overview):
            path = folder / f"{name}.png"
            save(drawn, path)
            data = base64.b64encode(path.read_bytes()).decode("ascii")
            written[name] = Figure(data, *(round(96 * x) for x in drawn.get_size_inches()))
    return written


def in_style() -> AbstractContextManager[None]:
    """Context manager with the style for drawing and saving figures."""
    # Seven colours, then the same colours dashed.
    styles = cycler(linestyle=("-", "--")) * cycler(color=COLOURS)
    return rc_context({**_STYLE, "axes.prop_cycle": styles})


def save(figure: "Drawing", png: str | os.PathLike[str]) -> None:
    """Write a PNG file without a creation date."""
    with atomic_write(png, "wb") as file:
        figure.savefig(file, dpi=130, format="png", metadata={"Software": None})


def _drawn(overview: Overview) -> "Iterator[tuple[str, Drawing]]":
    """Yield name and drawing of each figure, of the best configurations."""
    names = {index: overview.names[index] for index in overview.ranked[:MOST_LINES]}
    best = {name: overview.summaries[index] for index, name in names.items()}
    if not best:
        return
    of_all = overview.curves[overview.curves.object == ALL]
    curves = {
        (names[index], curve): rows[["value", "lower", "upper"]].to_numpy().T
        for (index, curve), rows in of_all.groupby(["configuration", "curve"])
        if index in names
    }
    yield "success-curves", accuracy_curves([*best], curves)
    quantiles = {name: summary.quantiles for name, summary in best.items()}
    yield "error-over-time", error_over_time(overview.results.start_frame + 1, quantiles)
    if counts := {n: each.pit_values for n, each in best.items() if each.pit_values.any()}:
        yield "calibration", calibration(counts)
    if found := {n: each.confidence for n, each in best.items() if each.confidence.frames[-1]}:
        yield "confidence", confidence(found)
    if lines := lines_over_particles(overview):
        yield "against-time", against_time(overview, lines)


def accuracy_curves(
    methods: Sequence[str], curves: Mapping[tuple[str, str], np.ndarray]
) -> "Drawing":
    """Draw success and precision curves (wu2013) with their intervals.

    Args:
        methods: names for the legend.
        curves: (method, name of a curve) -> value, lower and upper end, ``[3, K]``.
    """
    figure, axes = _axes(len(methods), len(CURVES))
    for axis, (name, thresholds) in zip(axes, CURVES.items(), strict=True):
        for method in methods:
            value, lower, upper = 100 * curves[method, name]
            shown = value.mean() if name == "success" else value[DISTANCE]
            (line,) = axis.plot(thresholds, value, label=f"{_wrapped(method)} [{shown:.0f}]")
            style = {"color": line.get_color(), "alpha": 0.15, "linewidth": 0}
            axis.fill_between(thresholds, lower, upper, **style)
        axis.set(xlim=(0, thresholds[-1]), ylim=(0, 102), ylabel="frames (%)")
        _legend_below(axis)
    axes[0].set(title="success [AUC]", xlabel="IoU above")
    axes[1].set(title=f"precision [within {DISTANCE} pixels]", xlabel="centre error up to, pixels")
    return figure


def error_over_time(first_frame: int, quantiles: Mapping[str, np.ndarray]) -> "Drawing":
    """Draw quantiles of the centre error of all objects, with a panel per configuration."""
    columns = min(len(quantiles), 4)
    rows = -(-len(quantiles) // columns)
    size = (max(4.5, 2.3 * columns), 0.7 + 1.75 * rows)
    figure, axes = new_figure(rows, columns, figsize=size)
    everything = np.array([*quantiles.values()])
    frames = first_frame + np.arange(everything.shape[-1])
    top = 1.04 * max(float(np.max(everything, where=np.isfinite(everything), initial=0)), 1.0)
    for axis in axes.flat[len(quantiles) :]:
        axis.set_visible(False)
    for axis, name, of_errors in zip(axes.flat, quantiles, everything, strict=False):
        low, quarter, median, three_quarters, high = of_errors
        for ends, alpha in (((low, high), 0.22), ((quarter, three_quarters), 0.45)):
            axis.fill_between(frames, *ends, color=COLOURS[0], alpha=alpha, linewidth=0)
        axis.plot(frames, median, "k", linewidth=1.2, marker="." * (len(frames) == 1))
        title = "\n".join(textwrap.fill(part, 26) for part in name.split(", "))
        axis.set(title=title, ylim=(0, top), xlabel="frame", ylabel="centre error (px)")
        axis.label_outer()
    return figure


def lines_over_particles(overview: Overview) -> dict[str, list[int]]:
    """Group the timed configurations that differ in the number of particles alone.

    Each group, keyed by the common name, is sorted by that number and has at least two entries.
    """

    configurations, speeds = overview.results.configurations, overview.results.speeds

    def number(index: int) -> float:
        return configurations[index].parameters["num_particles"]

    lines: dict[str, list[int]] = {}
    for index in overview.summaries:
        if np.isfinite(speeds[index]) and "num_particles" in configurations[index].parameters:
            name = overview.names[index].replace(f", num_particles {number(index)}", "")
            lines.setdefault(name, []).append(index)
    return {name: sorted(line, key=number) for name, line in lines.items() if len(line) > 1}


def against_time(overview: Overview, lines: Mapping[str, Sequence[int]]) -> "Drawing":
    """Draw success AUC and centre error against time per frame, see ``lines_over_particles``."""
    figure, axes = _axes(len(lines), 2)
    speeds = overview.results.speeds
    for axis, name in zip(axes, ("success_auc", "centre_error"), strict=True):
        measure = by_name(name)
        for label, line in lines.items():
            values = intervals(overview.estimates, name, ALL, line)
            value, lower, upper = values.T * (100 if measure.percent else 1)
            times = [1000 / speeds[index] for index in line]
            _error_bars(axis, times, value, [value - lower, upper - value], label)
        axis.set(xscale="log", xlabel="ms a frame", ylabel=heading_of(measure))
        axis.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axis.xaxis.set_major_formatter("{x:g}")
        axis.xaxis.set_minor_locator(NullLocator())
    _legend_below(axes[0])
    return figure


def calibration(pit_values: Mapping[str, np.ndarray]) -> "Drawing":
    """Draw coverage of central regions of x and y against their probability."""
    figure, (axis,) = _axes(len(pit_values))
    for name, counts in pit_values.items():
        half = len(counts) // 2
        inside = [counts[half - k : half + k].sum() for k in range(half + 1)]
        shares = 100 * np.array(inside) / counts.sum()
        axis.plot(np.linspace(0, 100, half + 1), shares, label=_wrapped(name))
    _finish_diagonal(axis, "probability of the region (%)", "truth inside (% of frames)")
    return figure


def confidence(reliabilities: Mapping[str, Reliability]) -> "Drawing":
    """Draw the share of boxes on their object against the confidence."""
    figure, (axis,) = _axes(len(reliabilities))
    for number, (name, reliability) in enumerate(reliabilities.items()):
        bins = reliability.bins
        middles = 100 * (np.arange(bins) + 0.5) / bins
        value, _, lower, upper = (100 * x[:bins] for x in reliability.shares())
        places = middles + 1.5 * (number - (len(reliabilities) - 1) / 2)
        reach = np.nan_to_num([value - lower, upper - value])
        _error_bars(axis, places, value, reach, name)
    _finish_diagonal(axis, "confidence (%)", "boxes on their object (%)")
    return figure


def _axes(lines: int, columns: int = 1) -> "tuple[Drawing, Any]":
    """A figure with axes side by side and room for a legend of so many lines below each."""
    figure, axes = new_figure(1, columns, figsize=(4.6 * columns, 3.9 + 0.17 * lines))
    return figure, axes[0]


def _error_bars(
    axis: "Axes", x: "ArrayLike", values: "ArrayLike", reach: "ArrayLike", name: str
) -> None:
    """Draw values with bars that reach as far below and above, ``[2, ...]``."""
    axis.errorbar(x, values, reach, label=_wrapped(name), marker="o", markersize=3.5, capsize=2)


def _finish_diagonal(axis: "Axes", xlabel: str, ylabel: str) -> None:
    """Finish a chart of shares, in per cent, that should lie on the diagonal."""
    axis.plot([0, 100], [0, 100], ":", color="0.4", zorder=1)
    axis.set(xlabel=xlabel, ylabel=ylabel, xlim=(0, 100), ylim=(-2, 102))
    _legend_below(axis)


def _legend_below(axis: "Axes") -> None:
    """Place the legend below the axes, where it covers no curve."""
    axis.legend(fontsize=7, loc="upper center", bbox_to_anchor=(0.5, -0.16))


def _wrapped(name: str) -> str:
    return textwrap.fill(name, 44)
