"""Figure 4 and recovery of object 1."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from jaxpf.media import plotting
from jaxpf.papers.judging.claims import Measured
from jaxpf.papers.judging.estimates import mean_of, rate_of
from jaxpf.papers.smith2004.measure import Measurement
from jaxpf.papers.smith2004.published import SHARPNESS, TABLE_2
from jaxpf.papers.smith2004.scenes import METHODS, NUM_OBJECTS, Outcome, order_name, shifted


def figures(measured: Measurement) -> dict[str, Any]:
    """File-name stem -> figure."""
    return {
        "figure_4": figure_4(measured.outcome),
        "recovery": figure_recovery(measured.outcome),
    }


def figure_4(outcome: Outcome) -> Any:
    """Uniqueness and effective dynamics in u and v for all objects, as in the paper."""
    rows = ["Non-PS", order_name(shifted(0)), order_name(shifted(1)), "DPS", "SPS"]
    figure, axes = plotting.new_figure(len(rows), 3, figsize=(10, 10))
    objects = np.arange(1, NUM_OBJECTS + 1)
    top = 100 * float(np.nanmax(outcome.dynamics[:, :, 0].mean(axis=0))) * 1.05
    for row, name in enumerate(rows):
        place = outcome.names.index(name)
        series = [
            ("uniqueness", outcome.uniqueness[:, place, 0], 105.0),
            ("effective dynamics, u", outcome.dynamics[:, place, 0, :, 0], top),
            ("effective dynamics, v", outcome.dynamics[:, place, 0, :, 1], top),
        ]
        for column, (title, values, limit) in enumerate(series):
            axis = axes[row, column]
            axis.bar(objects, 100 * values.mean(axis=0), color=plotting.colours(NUM_OBJECTS))
            axis.set(ylim=(0, limit), xticks=objects)
            axis.grid(axis="y", alpha=0.3)
            if row == 0:
                axis.set_title(f"{title} (%)")
            if column == 0:
                axis.set_ylabel(name)
    for axis in axes[-1]:
        axis.set_xlabel("object")
    figure.suptitle(
        f"Figure 4 repeated: sharpness {SHARPNESS[0]:g}; effective dynamics is the standard "
        "deviation of the particles over the process noise"
    )
    return figure


def figure_recovery(outcome: Outcome) -> Any:
    """Recovery of object 1: rates, differences from PS scene by scene, and PS's orders."""
    figure, axes = plotting.new_figure(1, 3, figsize=(15, 4.8))
    rates, differences, orders = axes[0]
    recovered = outcome.recovered.mean(axis=-1)
    for place, (method, colour) in enumerate(
        zip(METHODS, plotting.colours(len(METHODS)), strict=True)
    ):
        by_scene = recovered[:, outcome.of(method)].mean(axis=1)  # [S, L]
        at = np.array(SHARPNESS) + (place - 2) * 1.2
        cells = [rate_of(column).measured() for column in by_scene.T]
        _points(rates, at, cells, colour, method)
        published = TABLE_2["recovery"].get("PS mean" if method == "PS" else method)
        if published:
            rates.plot(at, published, "x", color=colour, ms=9, mew=2)
        if method == "PS":
            continue
        gaps = 100 * (by_scene - recovered[:, outcome.orders()].mean(axis=1))
        cells = [mean_of(gap).measured() for gap in gaps.T]
        _points(differences, at, cells, colour, method)
        if published:
            gap = np.subtract(published, TABLE_2["recovery"]["PS mean"])
            differences.plot(at, gap, "x", color=colour, ms=9, mew=2)
    rates.set(ylabel="object 1 recovered (% of runs)", ylim=(-3, 103))
    differences.set(ylabel="points above the mean of PS's orders, by scene")
    differences.axhline(0, color="gray", lw=1)
    for axis in (rates, differences):
        axis.set(xlabel="sharpness (crosses: published)", xticks=SHARPNESS)
        axis.grid(alpha=0.3)
    pooled = recovered[:, outcome.orders()].mean(axis=-1)  # [S, K], over sharpness values
    gaps = 100 * (pooled - pooled.mean(axis=1, keepdims=True))
    cells = [mean_of(gap).measured() for gap in gaps.T]
    _points(orders, np.arange(1, NUM_OBJECTS + 1), cells, "black", "PS")
    orders.axhline(0, color="gray", lw=1)
    reach = max(30.0, 1.1 * float(np.nanmax(np.abs(cells))))  # no interval is cut off
    orders.set(
        xlabel="object that PS treats first",
        ylabel="points above the mean of PS's orders, all sharpness",
        ylim=(-reach, reach),
    )
    orders.grid(alpha=0.3)
    figure.legend(*rates.get_legend_handles_labels(), loc="outside upper center", ncols=5)
    return figure


def _points(
    axis: Any, at: Any, cells: Sequence[Measured], colour: Any, label: str, linestyle: str = ""
) -> None:
    value, low, high = np.array(cells).T
    errors = np.clip([value - low, high - value], 0, None)
    axis.errorbar(at, value, errors, marker="o", ls=linestyle, color=colour, capsize=3, label=label)
