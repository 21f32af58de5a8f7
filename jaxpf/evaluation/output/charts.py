"""Draws the figures of an evaluation: one function per figure."""

import textwrap
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.ticker import LogLocator, NullLocator

from jaxpf.evaluation.measuring.collection import Summary
from jaxpf.evaluation.measuring.measures import CURVES, DISTANCE, by_name
from jaxpf.evaluation.output.layout import heading, triples
from jaxpf.media.plotting import new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike

#: Okabe and Ito (2008): the colours visible on white, most distinct first.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
#: Most configurations in the figures, the best ones.
MOST_LINES = 8


def accuracy_curves(
    methods: Sequence[str], curves: Mapping[tuple[str, str], Sequence[np.ndarray] | np.ndarray]
) -> "Figure":
    """Draw success and precision curves (wu2013) with their intervals.

    Args:
        methods: names for the legend.
        curves: (method, name of a curve) -> value, lower and upper end, ``[3, K]``.
    """
    figure, axes = _axes(len(methods), len(CURVES))
    for axis, (name, thresholds) in zip(axes, CURVES.items(), strict=True):
        for method in methods:
            value, lower, upper = 100 * np.asarray(curves[method, name])
            shown = value.mean() if name == "success" else value[DISTANCE]
            (line,) = axis.plot(thresholds, value, label=f"{_wrapped(method)} [{shown:.0f}]")
            style = {"color": line.get_color(), "alpha": 0.15, "linewidth": 0}
            axis.fill_between(thresholds, lower, upper, **style)
        axis.set(xlim=(0, thresholds[-1]), ylim=(0, 102), ylabel="frames (%)")
        _legend_below(axis)
    axes[0].set(title="success [AUC]", xlabel="IoU above")
    axes[1].set(title=f"precision [within {DISTANCE} pixels]", xlabel="centre error up to, pixels")
    return figure


def error_over_time(first_frame: int, summaries: Sequence[Summary]) -> "Figure":
    """Draw quantiles of the centre error of all objects, with a panel per configuration."""
    columns = min(len(summaries), 4)
    rows = -(-len(summaries) // columns)
    size = (max(4.5, 2.3 * columns), 0.7 + 1.75 * rows)
    figure, axes = new_figure(rows, columns, figsize=size)
    everything = np.array([summary.quantiles for summary in summaries])
    frames = first_frame + np.arange(everything.shape[-1])
    top = 1.04 * max(float(np.max(everything, where=np.isfinite(everything), initial=0)), 1.0)
    for axis in axes.flat[len(summaries) :]:
        axis.set_visible(False)
    for axis, summary, quantiles in zip(axes.flat, summaries, everything, strict=False):
        low, quarter, median, three_quarters, high = quantiles
        for ends, alpha in (((low, high), 0.22), ((quarter, three_quarters), 0.45)):
            axis.fill_between(frames, *ends, color=COLOURS[0], alpha=alpha, linewidth=0)
        axis.plot(frames, median, "k", linewidth=1.2, marker="." * (len(frames) == 1))
        name = "\n".join(textwrap.fill(part, 26) for part in summary.name.split(", "))
        axis.set(title=name, ylim=(0, top), xlabel="frame", ylabel="centre error (px)")
        axis.label_outer()
    return figure


def against_time(lines: Mapping[str, Sequence[Summary]]) -> "Figure":
    """Draw success AUC and centre error against time per frame.

    Args:
        lines: result of ``lines_over_particles``.
    """
    figure, axes = _axes(len(lines), 2)
    for axis, name in zip(axes, ("success_auc", "centre_error"), strict=True):
        measure = by_name(name)
        for label, line in lines.items():
            values = triples([summary.estimates[name] for summary in line], -1)
            value, lower, upper = values.T * (100 if measure.percent else 1)
            times = [1000 / speed_of(summary) for summary in line]
            _error_bars(axis, times, value, [value - lower, upper - value], label)
        axis.set(xscale="log", xlabel="ms a frame", ylabel=heading(measure))
        axis.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axis.xaxis.set_major_formatter("{x:g}")
        axis.xaxis.set_minor_locator(NullLocator())
    _legend_below(axes[0])
    return figure


def lines_over_particles(summaries: Sequence[Summary]) -> dict[str, list[Summary]]:
    """Group timed configurations that differ in the number of particles alone.

    Each group, keyed by the common name, is sorted by that number and has at least two entries.
    """

    def number(summary: Summary) -> float:
        return summary.configuration.parameters["num_particles"]

    lines: dict[str, list[Summary]] = {}
    for summary in summaries:
        if np.isfinite(speed_of(summary)) and "num_particles" in summary.configuration.parameters:
            name = summary.name.replace(f", num_particles {number(summary)}", "")
            lines.setdefault(name, []).append(summary)
    return {name: sorted(line, key=number) for name, line in lines.items() if len(line) > 1}


def speed_of(summary: Summary) -> float:
    """Frames per second of a configuration; NaN if not measured."""
    return float(summary.estimates["frames_per_second"].value[-1])


def calibration(summaries: Sequence[Summary]) -> "Figure":
    """Draw coverage of central regions of x and y against their probability."""
    figure, (axis,) = _axes(len(summaries))
    for summary in summaries:
        counts = summary.pit_values
        half = len(counts) // 2
        inside = [counts[half - k : half + k].sum() for k in range(half + 1)]
        shares = 100 * np.array(inside) / counts.sum()
        axis.plot(np.linspace(0, 100, half + 1), shares, label=_wrapped(summary.name))
    _finish_diagonal(axis, "probability of the region (%)", "truth inside (% of frames)")
    return figure


def confidence(summaries: Sequence[Summary]) -> "Figure":
    """Draw the share of boxes on their object against the confidence."""
    figure, (axis,) = _axes(len(summaries))
    bins = summaries[0].confidence.bins
    middles = 100 * (np.arange(bins) + 0.5) / bins
    for number, summary in enumerate(summaries):
        value, _, lower, upper = (100 * x[:bins] for x in summary.confidence.shares())
        places = middles + 1.5 * (number - (len(summaries) - 1) / 2)
        reach = np.nan_to_num([value - lower, upper - value])
        _error_bars(axis, places, value, reach, summary.name)
    _finish_diagonal(axis, "confidence (%)", "boxes on their object (%)")
    return figure


def _axes(lines: int, columns: int = 1) -> "tuple[Figure, Any]":
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
