"""Draws the figures of an evaluation: one function per figure, for 1 to 40 configurations."""

import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from jaxpf.evaluation.equal_time import curves, times_of
from jaxpf.evaluation.measures import CURVES, DISTANCE, by_name
from jaxpf.evaluation.output.layout import heading, object_name, triples
from jaxpf.evaluation.summary import Summary
from jaxpf.measures.scores import OVERLAP_THRESHOLDS
from jaxpf.media.plotting import new_figure

#: Okabe and Ito (2008): the colours visible on white, most distinct first.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
#: Most objects with a panel each; beyond that, those with the lowest recovery.
MOST_OBJECTS = 8
#: Most configurations in figures of curves, the best ones.
MOST_LINES = 8


def overlaps(ids: Sequence[int], summaries: Sequence[Summary]) -> Any:
    """Draw success at .5 and success area, with a panel per object, all objects first."""
    places = list(range(len(ids)))
    if len(ids) > MOST_OBJECTS:
        recovery = np.nanmean([s.estimates["recovered"].value[:-1] for s in summaries], axis=0)
        places = sorted(np.argsort(recovery, kind="stable")[:MOST_OBJECTS].tolist())
    if len(ids) > 1:
        places = [len(ids), *places]
    figure, axes = _forest(summaries, len(places), 1.25 if len(places) > 1 else 4)
    for axis, place in zip(axes, places, strict=True):
        for index, name in enumerate(("success_half", "success_area")):
            values = 100 * triples([summary.estimates[name] for summary in summaries], place)
            label, shift = by_name(name).title, 0.34 * index - 0.17
            _points(axis, values, shift, COLOURS[index], "oD"[index], label)
        axis.set(title=object_name(ids, place), xlim=(-4, 104), xticks=(0, 50, 100))
        axis.set_xlabel("% of frames")
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), frameon=False)
    return figure


def _forest(summaries: Sequence[Summary], columns: int, width: float) -> tuple[Any, Any]:
    """Make axes side by side with one row per configuration, the first on top."""
    count = len(summaries)
    size = (2.2 + width * columns, 1.3 + 0.27 * count)
    figure, axes = new_figure(1, columns, figsize=size)
    for index, axis in enumerate(axes[0]):
        axis.set_ylim(count - 0.5, -0.5)
        labels = [_wrapped(summary.name) for summary in summaries] if index == 0 else []
        axis.set_yticks(range(count), labels) if labels else axis.set_yticks([])
        axis.tick_params(axis="y", length=0)
        axis.spines["left"].set_visible(False)
        axis.grid(axis="x", alpha=0.3)
        for row in range(0, count, 2):
            axis.axhspan(row - 0.5, row + 0.5, color="0.95", zorder=0)
        for row in _new_settings(summaries):
            axis.axhline(row - 0.5, color="0.55", linewidth=0.8, zorder=1)
    return figure, axes[0]


def _new_settings(summaries: Sequence[Summary]) -> list[int]:
    """Rows at which the parameters change."""
    parameters = [summary.configuration.parameters for summary in summaries]
    return [row for row in range(1, len(parameters)) if parameters[row] != parameters[row - 1]]


def _points(
    axis: Any, values: np.ndarray, shift: float, colour: str, marker: str, name: str
) -> None:
    value, lower, upper = values.T
    rows = np.arange(len(value)) + shift
    ends = np.isfinite(lower) & np.isfinite(upper)
    axis.hlines(rows[ends], lower[ends], upper[ends], color=colour, linewidth=1.3, zorder=2)
    axis.plot(value, rows, marker, color=colour, markersize=4.2, label=name, zorder=3)


def error_over_time(first_frame: int, summaries: Sequence[Summary]) -> Any:
    """Draw quantiles of the centre error of all objects, with a panel per configuration."""
    count = len(summaries)
    columns = min(count, 4)
    rows = -(-count // columns)
    size = (max(4.5, 2.3 * columns), 0.7 + 1.75 * rows)
    figure, axes = new_figure(rows, columns, figsize=size)
    everything = np.array([summary.quantiles[:, :, -1] for summary in summaries])
    frames = first_frame + np.arange(everything.shape[-1])
    top = 1.04 * max(float(np.max(everything, where=np.isfinite(everything), initial=0)), 1.0)
    for index, axis in enumerate(axes.flat):
        if index >= count:
            axis.set_visible(False)
            continue
        low, quarter, median, three_quarters, high = everything[index]
        axis.fill_between(frames, low, high, color=COLOURS[0], alpha=0.22, linewidth=0)
        axis.fill_between(
            frames, quarter, three_quarters, color=COLOURS[0], alpha=0.45, linewidth=0
        )
        axis.plot(frames, median, color="black", linewidth=1.2, marker="." * (len(frames) == 1))
        axis.set_title(_narrow(summaries[index].name, 26))
        axis.set(ylim=(0, top))
        axis.grid(alpha=0.3)
        if index + columns >= count:
            axis.set_xlabel("frame")
        else:
            axis.tick_params(labelbottom=False)
        if index % columns == 0:
            axis.set_ylabel("centre error (px)")
        else:
            axis.tick_params(labelleft=False)
    return figure


def against_time(summaries: Sequence[Summary], place: int) -> Any:
    """Draw success area and centre error against time per frame; lines join particle numbers."""
    from matplotlib.ticker import LogLocator, NullLocator, StrMethodFormatter

    lines = curves(summaries)
    figure, axes = new_figure(1, 2, figsize=(9.2, 3.9 + 0.17 * min(len(lines), MOST_LINES)))
    for axis, name in zip(axes[0], ("success_area", "centre_error"), strict=True):
        measure = by_name(name)
        factor = 100 if measure.percent else 1
        for index, (label, line) in enumerate(lines.items()):
            values = triples([summary.estimates[name] for summary in line], place)
            value, lower, upper = factor * values.T
            times = 1000 * times_of([summary.frames_per_second for summary in line])
            _error_bars(axis, times, value, [value - lower, upper - value], index, label)
        axis.set(xscale="log", xlabel="ms a frame", ylabel=heading(measure))
        axis.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axis.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axis.xaxis.set_minor_locator(NullLocator())
        axis.grid(alpha=0.3)
    legend_below(axes[0][0])
    return figure


def calibration(summaries: Sequence[Summary]) -> Any:
    """Draw coverage of central regions of x and y against their probability."""
    figure, axes = new_figure(figsize=(4.6, 3.9 + 0.17 * len(summaries)))
    axis = axes[0][0]
    for number, summary in enumerate(summaries):
        bins = len(summary.transforms)
        share = summary.transforms / summary.transforms.sum()
        inside = np.arange(0, bins // 2 + 1)
        covered = [share[bins // 2 - k : bins // 2 + k].sum() for k in inside]
        label = _wrapped(summary.name)
        axis.plot(200 * inside / bins, 100 * np.array(covered), label=label, **line_style(number))
    _finish_diagonal(axis, "probability of the region (%)", "truth inside (% of frames)", 0)
    return figure


def confidence(summaries: Sequence[Summary]) -> Any:
    """Draw the share of boxes on their object against the confidence."""
    figure, axes = new_figure(figsize=(4.6, 3.9 + 0.17 * len(summaries)))
    axis = axes[0][0]
    bins = summaries[0].confidence.bins
    middles = 100 * (np.arange(bins) + 0.5) / bins
    for number, summary in enumerate(summaries):
        value, _, lower, upper = (100 * x[:bins] for x in summary.confidence.shares())
        places = middles + 1.5 * (number - (len(summaries) - 1) / 2)
        reach = np.nan_to_num([value - lower, upper - value])
        _error_bars(axis, places, value, reach, number, summary.name)
    _finish_diagonal(axis, "confidence (%)", "boxes on their object (%)", -2)
    return figure


def _error_bars(axis: Any, x: Any, values: Any, reach: Any, number: int, name: str) -> None:
    """Draw values with bars that reach as far below and above, ``[2, ...]``."""
    style = {"marker": "o", "markersize": 3.5, "capsize": 2, **line_style(number)}
    axis.errorbar(x, values, reach, label=_wrapped(name), **style)


def _finish_diagonal(axis: Any, xlabel: str, ylabel: str, lowest: float) -> None:
    """Finish a chart of shares, in per cent, that should lie on the diagonal."""
    axis.plot([0, 100], [0, 100], ":", color="0.4", zorder=1)
    axis.set(xlabel=xlabel, ylabel=ylabel, xlim=(0, 100), ylim=(lowest, 102))
    axis.grid(alpha=0.3)
    legend_below(axis)


def success_curves(summaries: Sequence[Summary]) -> Any:
    """Draw success curves of all objects (wu2013)."""
    figure, axes = new_figure(figsize=(4.6, 3.9 + 0.17 * len(summaries)))
    axis = axes[0][0]
    for index, summary in enumerate(summaries):
        curve, area = summary.success, summary.estimates["success_area"].value[-1]
        label, style = f"{_wrapped(summary.name)} [{100 * area:.1f}]", line_style(index)
        axis.plot(OVERLAP_THRESHOLDS, 100 * curve.value[-1], label=label, **style)
        ends = 100 * curve.lower[-1], 100 * curve.upper[-1]
        axis.fill_between(OVERLAP_THRESHOLDS, *ends, color=style["color"], alpha=0.18, linewidth=0)
    axis.set(xlabel="overlap threshold", ylabel="frames above the threshold (%)")
    axis.set(xlim=(0, 1), ylim=(0, 102))
    axis.grid(alpha=0.3)
    legend_below(axis)
    return figure


def curves_over_sequences(
    methods: Sequence[str], curves: Mapping[tuple[str, str], np.ndarray]
) -> Any:
    """Draw success and precision curves with sequences as units.

    Args:
        methods: names for the legend.
        curves: (method, curve) -> number of sequences, mean and interval, ``[K, 4]``.
    """
    size = (9.2, 3.9 + 0.17 * min(len(methods), MOST_LINES))
    figure, axes = new_figure(1, len(CURVES), figsize=size)
    for axis, (name, thresholds) in zip(axes[0], CURVES.items(), strict=True):
        for number, method in enumerate(methods):
            _, mean, lower, upper = 100 * curves[method, name].T
            shown = mean.mean() if name == "success" else mean[DISTANCE]
            style = line_style(number)
            axis.plot(thresholds, mean, label=f"{_wrapped(method)} [{shown:.0f}]", **style)
            axis.fill_between(
                *(thresholds, lower, upper), color=style["color"], alpha=0.13, linewidth=0
            )
        axis.set(xlim=(0, thresholds[-1]), ylim=(0, 102), ylabel="frames (%)")
        axis.grid(alpha=0.3)
        legend_below(axis)
    axes[0][0].set(title="success [area]", xlabel="overlap above")
    axes[0][1].set(
        title=f"precision [within {DISTANCE} pixels]", xlabel="centre error up to, pixels"
    )
    return figure


def line_style(number: int) -> dict[str, str]:
    """Style of the line with index ``number``: seven colours, then the same colours dashed."""
    dashes, colour = divmod(number, len(COLOURS))
    return {"color": COLOURS[colour], "linestyle": ("-", "--")[dashes % 2]}


def legend_below(axis: Any) -> None:
    """Place the legend below the axes, where it covers no curve."""
    axis.legend(fontsize=7, loc="upper center", bbox_to_anchor=(0.5, -0.16))


def _narrow(name: str, width: int) -> str:
    """Break a name into lines: the method, then each parameter."""
    return "\n".join(textwrap.fill(part, width) for part in name.split(", "))


def _wrapped(name: str) -> str:
    return textwrap.fill(name, 44)
