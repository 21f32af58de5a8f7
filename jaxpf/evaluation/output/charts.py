"""Draws the figures of an evaluation: one function per figure, for 1 to 40 configurations."""

import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from jaxpf.evaluation.equal_time import curves, times_of
from jaxpf.evaluation.measures import COMPARED, COORDINATES, CURVES, DISTANCE, by_name
from jaxpf.evaluation.output.layout import difference_heading, heading, object_name, triples
from jaxpf.evaluation.output.tables import Tables
from jaxpf.evaluation.results import Results
from jaxpf.evaluation.summary import Summary
from jaxpf.measures.scores import OVERLAP_THRESHOLDS
from jaxpf.media.plotting import new_figure

#: Okabe and Ito (2008): the colours visible on white, most distinct first.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
#: With at least this many configurations, figures show less detail.
MANY = 13
#: Most objects with a panel each; beyond that, those with the lowest recovery.
MOST_OBJECTS = 8
#: Most success curves with a colour each; beyond that, each method has a colour.
MOST_LINES = 8


def overlaps(results: Results, tables: Tables) -> Any:
    """Draw the share of frames with overlap above .5, and the area under the success curve."""
    return _per_object(results, tables, ("success_half", "success_area"), "% of frames")


def rates(results: Results, tables: Tables) -> Any:
    """Draw success and recovery (smith2004)."""
    return _per_object(results, tables, ("success", "recovered"), "% of runs")


def _per_object(results: Results, tables: Tables, names: Sequence[str], unit: str) -> Any:
    """Draw two measures with a panel per object, all objects first."""
    summaries, ids = tables.summaries, results.object_ids
    places = list(range(len(ids)))
    if len(ids) > MOST_OBJECTS:
        recovery = np.nanmean([s.estimates["recovered"].value[:-1] for s in summaries], axis=0)
        places = sorted(np.argsort(recovery, kind="stable")[:MOST_OBJECTS].tolist())
    if len(ids) > 1:
        places = [len(ids), *places]
    figure, axes = _forest(summaries, len(places), 1.25 if len(places) > 1 else 4)
    for axis, place in zip(axes, places, strict=True):
        for index, name in enumerate(names):
            found = 100 * triples([summary.estimates[name] for summary in summaries], place)
            label, shift = by_name(name).title, 0.34 * index - 0.17
            _points(axis, found, shift, COLOURS[index], "oD"[index], label)
        axis.set(title=object_name(ids, place), xlim=(-4, 104), xticks=(0, 50, 100))
        axis.set_xlabel(unit)
    _legend(figure, axes[0])
    return figure


def differences(results: Results, tables: Tables, places: Sequence[int]) -> Any:
    """Draw paired differences of the ``COMPARED`` measures for the objects at ``places``."""
    summaries = tables.summaries
    compared = [summary for summary in summaries if summary.reference is not None]
    figure, axes = _forest(compared, len(COMPARED), 2.0)
    for axis, measure in zip(axes, COMPARED, strict=True):
        factor = 100 if measure.percent else 1
        axis.axvline(0, color="0.4", linewidth=0.8, zorder=1)
        for index, place in enumerate(places):
            found = triples([summary.differences[measure.name] for summary in compared], place)
            shift = 0.17 * (2 * index - 1) if len(places) > 1 else 0
            label = object_name(results.object_ids, place)
            _points(axis, factor * found, shift, COLOURS[index], "oD"[index], label)
        axis.set_xlabel(difference_heading(measure))
    names = {summaries[s.reference].name for s in compared if s.reference is not None}
    first = names.pop() if len(names) == 1 else "the first method of equal parameters"
    figure.suptitle(f"difference from {first}")
    _legend(figure, axes[0])
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
    axis: Any, found: np.ndarray, shift: float, colour: str, marker: str, name: str
) -> None:
    value, lower, upper = found.T
    rows = np.arange(len(value)) + shift
    known = np.isfinite(lower) & np.isfinite(upper)
    axis.hlines(rows[known], lower[known], upper[known], color=colour, linewidth=1.3, zorder=2)
    axis.plot(value, rows, marker, color=colour, markersize=4.2, label=name, zorder=3)


def _legend(figure: Any, axis: Any) -> None:
    handles, labels = axis.get_legend_handles_labels()
    if len(labels) > 1:
        figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), frameon=False)


def diversity(ids: Sequence[int], summaries: Sequence[Summary]) -> Any:
    """Draw uniqueness and effective dynamics of every object (smith2004, figures 4 and 8)."""
    columns = [
        ("uniqueness", "uniqueness (%)"),
        *((f"effective_dynamics_{x}", f"effective dynamics in {x} (%)") for x in COORDINATES[:2]),
    ]
    # Parts attached to a parent have no process noise in x and y.
    columns = [
        (name, title)
        for name, title in columns
        if np.isfinite([summary.estimates[name].value for summary in summaries]).any()
    ]
    draw = _diversity_bars if len(summaries) < MANY else _diversity_map
    return draw([f"{identity}" for identity in ids], summaries, columns)


def _diversity_bars(
    ids: Sequence[str], summaries: Sequence[Summary], columns: Sequence[tuple[str, str]]
) -> Any:
    width = max(2.4, 0.32 * len(ids))
    size = (len(columns) * width + 1.2, 1.0 + 1.15 * len(summaries))
    figure, axes = new_figure(len(summaries), len(columns), share_x=True, figsize=size)
    for column, (name, title) in enumerate(columns):
        estimates = [summary.estimates[name] for summary in summaries]
        ends = [[estimate.value, estimate.upper] for estimate in estimates]
        top = 100 * float(np.nanmax(ends, initial=0.01))
        for row, estimate in enumerate(estimates):
            axis = axes[row, column]
            value, lower, upper = (
                100 * x[:-1] for x in (estimate.value, estimate.lower, estimate.upper)
            )
            errors = np.nan_to_num(np.clip([value - lower, upper - value], 0, None))
            style = {"elinewidth": 0.8, "ecolor": "black"}
            bars = axis.bar(
                ids, np.nan_to_num(value), yerr=errors, color=COLOURS[0], width=0.7, error_kw=style
            )
            if len(ids) <= 10:
                # The process noise of user-defined trackers may be unknown.
                labels = [f"{x:.{x < 9.95:d}f}" if np.isfinite(x) else "" for x in value]
                axis.bar_label(bars, labels, fontsize=6.5, padding=2)
            axis.set_ylim(0, 1.22 * top)
            if column == 0:
                label = _narrow(summaries[row].name, 16)
                axis.set_ylabel(label, rotation=0, ha="right", va="center")
        axes[0, column].set_title(title)
        axes[-1, column].set_xlabel("object")
    return figure


def _diversity_map(
    ids: Sequence[str], summaries: Sequence[Summary], columns: Sequence[tuple[str, str]]
) -> Any:
    size = (2.2 + 3 * max(2.2, 0.33 * len(ids)), 1.2 + 0.24 * len(summaries))
    figure, axes = new_figure(1, len(columns), figsize=size)
    for axis, (name, title) in zip(axes[0], columns, strict=True):
        values = 100 * np.array([summary.estimates[name].value[:-1] for summary in summaries])
        top = max(100.0, float(np.nanmax(values, initial=0.0)))
        axis.imshow(values, cmap="cividis", vmin=0, vmax=top, aspect="auto")
        for row, column in np.ndindex(*values.shape):
            if len(ids) <= 12 and np.isfinite(values[row, column]):
                ink = "white" if values[row, column] < 0.55 * top else "black"
                text = f"{values[row, column]:.{0 if values[row, column] >= 9.95 else 1}f}"
                axis.text(column, row, text, ha="center", va="center", fontsize=6.5, color=ink)
        for row in _new_settings(summaries):
            axis.axhline(row - 0.5, color="white", linewidth=2)
        axis.set_xticks(range(len(ids)), ids)
        axis.set(title=title, xlabel="object")
        axis.set_yticks(range(len(summaries)), [""] * len(summaries))
        axis.tick_params(length=0)
    axes[0, 0].set_yticklabels([_wrapped(summary.name) for summary in summaries])
    return figure


def error_over_time(results: Results, summaries: Sequence[Summary], place: int) -> Any:
    """Draw quantiles of one object's centre error, with a panel per configuration."""
    count = len(summaries)
    columns = min(count, 4 if count < MANY else 5)
    rows = -(-count // columns)
    size = (max(4.5, 2.3 * columns), 0.7 + 1.75 * rows)
    figure, axes = new_figure(rows, columns, figsize=size)
    frames = results.start_frame + 1 + np.arange(len(results.truth))
    everything = np.array([s.quantiles[:, :, place] for s in summaries])
    top = 1.04 * max(float(np.max(everything, where=np.isfinite(everything), initial=0)), 1.0)
    for index, axis in enumerate(axes.flat):
        if index >= count:
            axis.set_visible(False)
            continue
        low, quarter, median, three_quarters, high = summaries[index].quantiles[:, :, place]
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
            found = triples([summary.estimates[name] for summary in line], place)
            value, lower, upper = factor * found.T
            axis.errorbar(
                1000 * times_of([summary.frames_per_second for summary in line]),
                *(value, [value - lower, upper - value]),
                marker="o",
                markersize=3.5,
                capsize=2,
                **line_style(index),
                label=_wrapped(label),
            )
        axis.set(xscale="log", xlabel="ms a frame", ylabel=heading(measure))
        axis.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axis.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axis.xaxis.set_minor_locator(NullLocator())
        axis.grid(alpha=0.3)
    legend_below(axes[0][0])
    return figure


def calibration(summaries: Sequence[Summary]) -> Any:
    """Draw coverage of central regions against probability, and the transforms' histogram."""
    known = [summary for summary in summaries if summary.transforms.any()]
    figure, axes = new_figure(1, 2, figsize=(9.2, 3.9 + 0.17 * min(len(known), MOST_LINES)))
    left, right = axes[0]
    bins = len(known[0].transforms)
    inside = np.arange(0, bins // 2 + 1)
    # If there are too many lines for a legend, each method has one colour.
    names = [s.name if len(known) <= MOST_LINES else s.configuration.method for s in known]
    labels = list(dict.fromkeys(names))
    for number, label in enumerate(labels):
        style = line_style(number)
        left.plot([], [], label=_wrapped(label), **style)
        for summary in (s for s, name in zip(known, names, strict=True) if name == label):
            share = summary.transforms / summary.transforms.sum()
            covered = [share[bins // 2 - k : bins // 2 + k].sum() for k in inside]
            left.plot(200 * inside / bins, 100 * np.array(covered), **style)
            right.stairs(bins * share, np.linspace(0, 1, bins + 1), **style)
    left.plot([0, 100], [0, 100], ":", color="0.4", zorder=1)
    right.axhline(1, color="0.4", linestyle=":", zorder=1)
    left.set(xlabel="probability of the region (%)", ylabel="truth inside (% of frames)")
    left.set(xlim=(0, 100), ylim=(0, 102))
    right.set(xlabel="probability given to values below the truth", ylabel="density", xlim=(0, 1))
    for axis in axes[0]:
        axis.grid(alpha=0.3)
    legend_below(left)
    return figure


def success_curves(results: Results, summaries: Sequence[Summary], places: Sequence[int]) -> Any:
    """Draw success curves (wu2013) of the objects at ``places``."""
    size = (4.6 * len(places), 3.9 + 0.17 * min(len(summaries), MOST_LINES))
    figure, axes = new_figure(1, len(places), figsize=size)
    for axis, place in zip(axes[0], places, strict=True):
        draw = _single_curves if len(summaries) <= MOST_LINES else _grouped_curves
        draw(axis, summaries, place)
        axis.set(title=object_name(results.object_ids, place), xlim=(0, 1), ylim=(0, 102))
        axis.set(xlabel="overlap threshold", ylabel="frames above the threshold (%)")
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


def _single_curves(axis: Any, summaries: Sequence[Summary], place: int) -> None:
    for index, summary in enumerate(summaries):
        curve, area = summary.success, summary.estimates["success_area"].value[place]
        label, style = f"{_wrapped(summary.name)} [{100 * area:.1f}]", line_style(index)
        axis.plot(OVERLAP_THRESHOLDS, 100 * curve.value[place], label=label, **style)
        ends = 100 * curve.lower[place], 100 * curve.upper[place]
        axis.fill_between(OVERLAP_THRESHOLDS, *ends, color=style["color"], alpha=0.18, linewidth=0)


def _grouped_curves(axis: Any, summaries: Sequence[Summary], place: int) -> None:
    """Draw curves with one colour per method, for too many lines to label each."""
    methods = list(dict.fromkeys(summary.configuration.method for summary in summaries))
    for number, method in enumerate(methods):
        group = [s for s in summaries if s.configuration.method == method]
        areas = [100 * s.estimates["success_area"].value[place] for s in group]
        reach = f"{min(areas):.1f}" + (f" to {max(areas):.1f}" if len(areas) > 1 else "")
        for index, summary in enumerate(group):
            axis.plot(
                *(OVERLAP_THRESHOLDS, 100 * summary.success.value[place]),
                linewidth=1,
                alpha=0.8,
                label=f"{method} [{reach}]" if index == 0 else None,
                **line_style(number),
            )


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
