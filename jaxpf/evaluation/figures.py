"""Figures of an evaluation: drawn once, saved as PNG and as PDF, the same bytes every time."""

import functools
import os
import textwrap
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jaxpf.evaluation.layout import COMPARED, difference_heading, object_name
from jaxpf.evaluation.measures import COORDINATES, by_name
from jaxpf.evaluation.results import Results
from jaxpf.evaluation.summary import Summary
from jaxpf.evaluation.tables import Tables
from jaxpf.files import atomic_write, report_os_errors
from jaxpf.plotting import new_figure
from jaxpf.scores import OVERLAP_THRESHOLDS

#: Okabe and Ito (2008), the colours that show on white, most different first.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
#: From so many configurations on, figures show all of them in less detail.
MANY = 13
_MOST_OBJECTS = 8
_MOST_LINES = 8
_STYLE: dict[Any, Any] = {
    "text.parse_math": False,  # a dollar in a user's name is a dollar
    "font.size": 8.5,
    "axes.titlesize": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "pdf.fonttype": 42,  # letters that stay letters, which publishers ask for
}


class Figure(NamedTuple):
    """A figure that was saved.

    Attributes:
        name: of the files, without suffix.
        title: what it shows.
        caption: how to read it, and how its intervals were made.
        png: the file.
    """

    name: str
    title: str
    caption: str
    png: Path


class _Plan(NamedTuple):
    name: str
    title: str
    caption: str
    draw: Callable[[], Any]


def write_figures(results: Results, tables: Tables) -> list[Figure]:
    """Write all figures into the folder ``figures`` of the evaluation.

    Raises:
        InputError: a file cannot be written.
    """
    from matplotlib import rc_context

    folder = results.folder / "figures"
    with report_os_errors("create the folder", folder):
        folder.mkdir(exist_ok=True)
    if not tables.summaries:
        return []
    written = []
    with rc_context(_STYLE):
        for plan in _plans(results, tables):
            figure = plan.draw()
            path = folder / f"{plan.name}.png"
            save(figure, path)
            written.append(Figure(plan.name, plan.title, plan.caption, path))
    return written


def save(figure: Any, png: str | os.PathLike[str]) -> None:
    """Write ``png`` and, beside it, the same as PDF; neither tells when it was made."""
    # Arranged once, not once per file: that is what costs time.
    figure.draw_without_rendering()
    figure.set_layout_engine(None)
    with atomic_write(png, "wb") as file:
        figure.savefig(file, dpi=130, format="png", metadata={"Software": None})
    metadata = {"CreationDate": None, "Creator": None, "Producer": None}
    with atomic_write(Path(png).with_suffix(".pdf"), "wb") as file:
        figure.savefig(file, format="pdf", metadata=metadata)


def _plans(results: Results, tables: Tables) -> list[_Plan]:
    summaries, ids = tables.summaries, results.object_ids
    hardest = object_name(ids, tables.hardest)
    several = len(ids) > 1
    # The objects of most interest: all together, and the one that was recovered least.
    places = [len(ids), tables.hardest] if several else [0]
    plans = [
        _Plan(
            "rates",
            "Success and recovery",
            "Dots: share of the runs. Bars: 95 % intervals; Wilson's for one object, and for all "
            "objects at the effective number of trials, because objects of a run are alike."
            + (f" Of {len(ids)} objects, those recovered least." if _few(ids) else ""),
            lambda: _rates(results, tables),
        )
    ]
    if any(summary.reference is not None for summary in summaries):
        plans.append(
            _Plan(
                "differences",
                "Paired differences",
                "Each method less the one it is compared with, on common seeds. Bars: 95 % "
                "intervals of the difference, not corrected for the number of comparisons. Where a "
                "bar crosses the line at 0, these runs do not tell the two apart.",
                lambda: _differences(results, tables, places),
            )
        )
    filters = [s for s in summaries if np.isfinite(s.estimates["uniqueness"].value).any()]
    if filters:
        plans.append(
            _Plan(
                "diversity",
                "Uniqueness and effective dynamics per object",
                "As figures 4 and 8 of smith2004. Uniqueness: distinct draws over particles. "
                "Effective dynamics: standard deviation of the particle set over that of the "
                "process noise; it may exceed 100 %. Means over frames and runs"
                + (", with 95 % intervals over runs." if len(filters) < MANY else "."),
                lambda: _diversity(ids, filters),
            )
        )
    over = "runs and objects" if several else "runs"
    for place in places:
        which = object_name(ids, place)
        single = place != len(ids)
        plans.append(
            _Plan(
                f"error-over-time-{'all' if not single else f'object-{ids[place]}'}",
                f"Centre error over time: {which}",
                f"Line: median over {'runs' if single else over}. Dark band: the middle half. Pale "
                "band: from 5 to 95 %. These are quantiles, not intervals; frames without truth "
                "or estimate do not count."
                + (f" Of all objects, {hardest} was recovered least." * (single and several)),
                functools.partial(_error_over_time, results, summaries, place),
            )
        )
    plans.append(
        _Plan(
            "success-curves",
            "Success curves",
            "Share of the frames whose overlap with the truth exceeds a threshold (wu2013), the "
            "start frame left out. "
            + (
                "Bands: 95 % normal intervals over runs. In brackets: the area under the curve."
                if len(summaries) <= _MOST_LINES
                else "One line per configuration, one colour per method. In brackets: the areas "
                "under the curves."
            ),
            lambda: _success_curves(results, summaries, places),
        )
    )
    return plans


def _few(ids: Sequence[int]) -> bool:
    return len(ids) > _MOST_OBJECTS


def _rates(results: Results, tables: Tables) -> Any:
    summaries, ids = tables.summaries, results.object_ids
    places = list(range(len(ids)))
    if _few(ids):
        recovery = np.nanmean([s.estimates["recovered"].value[:-1] for s in summaries], axis=0)
        places = sorted(np.argsort(recovery, kind="stable")[:_MOST_OBJECTS].tolist())
    if len(ids) > 1:
        places = [len(ids), *places]
    figure, axes = _forest(summaries, len(places), 1.25 if len(places) > 1 else 4)
    for axis, place in zip(axes, places, strict=True):
        for name, colour, marker, shift in (
            ("success", COLOURS[0], "o", -0.17),
            ("recovered", COLOURS[1], "D", 0.17),
        ):
            found = [summary.estimates[name] for summary in summaries]
            triples = [[100 * x[place] for x in (e.value, e.lower, e.upper)] for e in found]
            _points(axis, triples, shift, colour, marker, by_name(name).title)
        axis.set(title=object_name(ids, place), xlim=(-4, 104), xticks=(0, 50, 100))
        axis.set_xlabel("% of runs")
    _legend(figure, axes[0])
    return figure


def _differences(results: Results, tables: Tables, places: Sequence[int]) -> Any:
    summaries = tables.summaries
    compared = [summary for summary in summaries if summary.reference is not None]
    figure, axes = _forest(compared, len(COMPARED), 2.0)
    for axis, measure in zip(axes, COMPARED, strict=True):
        factor = 100 if measure.percent else 1
        axis.axvline(0, color="0.4", linewidth=0.8, zorder=1)
        for index, place in enumerate(places):
            found = [summary.differences[measure.name] for summary in compared]
            triples = [[factor * x[place] for x in (d.value, d.lower, d.upper)] for d in found]
            shift = 0.17 * (2 * index - 1) if len(places) > 1 else 0
            label = object_name(results.object_ids, place)
            _points(axis, triples, shift, COLOURS[index], "oD"[index], label)
        axis.set_xlabel(difference_heading(measure))
    names = {summaries[s.reference].name for s in compared if s.reference is not None}
    first = names.pop() if len(names) == 1 else "the first method of equal parameters"
    figure.suptitle(f"difference from {first}")
    _legend(figure, axes[0])
    return figure


def _forest(summaries: Sequence[Summary], columns: int, width: float) -> tuple[Any, Any]:
    """Axes side by side with one row per configuration, the first on top."""
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
    return figure, axes[0]


def _points(
    axis: Any, triples: Sequence[Sequence[float]], shift: float, colour: str, marker: str, name: str
) -> None:
    value, lower, upper = np.asarray(triples, float).T
    rows = np.arange(len(value)) + shift
    known = np.isfinite(lower) & np.isfinite(upper)
    axis.hlines(rows[known], lower[known], upper[known], color=colour, linewidth=1.3, zorder=2)
    axis.plot(value, rows, marker, color=colour, markersize=4.2, label=name, zorder=3)


def _legend(figure: Any, axis: Any) -> None:
    handles, labels = axis.get_legend_handles_labels()
    if len(labels) > 1:
        figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), frameon=False)


def _diversity(ids: Sequence[int], summaries: Sequence[Summary]) -> Any:
    columns = [
        ("uniqueness", "uniqueness (%)"),
        *((f"effective_dynamics_{x}", f"effective dynamics in {x} (%)") for x in COORDINATES[:2]),
    ]
    draw = _diversity_bars if len(summaries) < MANY else _diversity_map
    return draw([f"{identity}" for identity in ids], summaries, columns)


def _diversity_bars(
    ids: Sequence[str], summaries: Sequence[Summary], columns: Sequence[tuple[str, str]]
) -> Any:
    width = max(2.4, 0.32 * len(ids))
    size = (3 * width + 1.2, 1.0 + 1.15 * len(summaries))
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
            bars = axis.bar(ids, np.nan_to_num(value), color=COLOURS[0], width=0.7)
            axis.errorbar(ids, value, errors, fmt="none", ecolor="black", elinewidth=0.8)
            if len(ids) <= 10:
                labels = [f"{x:.0f}" if x >= 9.95 else f"{x:.1f}" for x in value]
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
        axis.set_xticks(range(len(ids)), ids)
        axis.set(title=title, xlabel="object")
        first = axis is axes[0, 0]
        axis.set_yticks(range(len(summaries)), [_wrapped(s.name) for s in summaries] * first
                        or [""] * len(summaries))  # fmt: skip
        axis.tick_params(length=0)
    return figure


def _error_over_time(results: Results, summaries: Sequence[Summary], place: int) -> Any:
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


def _success_curves(results: Results, summaries: Sequence[Summary], places: Sequence[int]) -> Any:
    figure, axes = new_figure(1, len(places), figsize=(4.6 * len(places), 3.9))
    for axis, place in zip(axes[0], places, strict=True):
        draw = _single_curves if len(summaries) <= _MOST_LINES else _grouped_curves
        draw(axis, summaries, place)
        axis.set(title=object_name(results.object_ids, place), xlim=(0, 1), ylim=(0, 102))
        axis.set(xlabel="overlap threshold", ylabel="frames above the threshold (%)")
        axis.grid(alpha=0.3)
        axis.legend(fontsize=7, loc="lower left" if place == places[0] else "upper right")
    return figure


def _single_curves(axis: Any, summaries: Sequence[Summary], place: int) -> None:
    for index, summary in enumerate(summaries):
        curve, area = summary.curve, summary.estimates["success_area"].value[place]
        colour, dash = COLOURS[index % len(COLOURS)], ("-", "--")[index // len(COLOURS)]
        label = f"{_wrapped(summary.name)} [{100 * area:.1f}]"
        axis.plot(OVERLAP_THRESHOLDS, 100 * curve.value[place], dash, color=colour, label=label)
        ends = 100 * curve.lower[place], 100 * curve.upper[place]
        axis.fill_between(OVERLAP_THRESHOLDS, *ends, color=colour, alpha=0.18, linewidth=0)


def _grouped_curves(axis: Any, summaries: Sequence[Summary], place: int) -> None:
    """One colour per method; too many lines for a legend of all."""
    methods = list(dict.fromkeys(summary.configuration.method for summary in summaries))
    for number, method in enumerate(methods):
        group = [s for s in summaries if s.configuration.method == method]
        areas = [100 * s.estimates["success_area"].value[place] for s in group]
        reach = f"{min(areas):.1f}" + (f" to {max(areas):.1f}" if len(areas) > 1 else "")
        for index, summary in enumerate(group):
            axis.plot(
                *(OVERLAP_THRESHOLDS, 100 * summary.curve.value[place]),
                ("-", "--")[number // len(COLOURS) % 2],
                color=COLOURS[number % len(COLOURS)],
                linewidth=1,
                alpha=0.8,
                label=f"{method} [{reach}]" if index == 0 else None,
            )


def _narrow(name: str, width: int) -> str:
    """A name in lines: the method, then each parameter."""
    return "\n".join(textwrap.fill(part, width) for part in name.split(", "))


def _wrapped(name: str) -> str:
    return textwrap.fill(name, 44)
