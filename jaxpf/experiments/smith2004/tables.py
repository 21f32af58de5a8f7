"""Tables 1 and 2 and figure 4: published figures beside ours."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from jaxpf.experiments.claims import Measured, cluster_interval, student_interval
from jaxpf.experiments.comparison_table import Cell, Table
from jaxpf.experiments.smith2004.published import (
    BEST_ORDER_RECOVERY,
    FIRST_STAGE_UNIQUENESS,
    SHARPNESS,
    TABLE_1,
    TABLE_2,
)
from jaxpf.experiments.smith2004.synthetic import (
    METHODS,
    NUM_OBJECTS,
    RUNS_PER_SCENE,
    Outcome,
    order_name,
    shifted,
)
from jaxpf.media import plotting

_CHUNK = 100  # permutations at a time, for memory


def rate(values: np.ndarray, trials: int) -> Measured:
    """Rates of the scenes ``[S]``, 0 to 1, to a percentage with its interval."""
    return Measured(100 * float(np.mean(values)), *cluster_interval(values, trials)(0.95))


def mean(values: np.ndarray) -> Measured:
    """Shares of the scenes ``[S]``, 0 to 1, to a mean percentage with its interval."""
    values = 100 * np.asarray(values, float)
    finite = values[np.isfinite(values)]
    centre = float(finite.mean()) if len(finite) else float("nan")
    low, high = student_interval(values)(0.95)
    return Measured(centre, max(low, 0.0), min(high, 100.0))


def table_1(outcome: Outcome) -> list[Table]:
    """Success, precision and recall of objects 2 to 7."""
    measures = {
        "success": outcome.success,
        "precision": outcome.precision,
        "recall": outcome.recall,
    }
    tables = []
    for measure, values in measures.items():
        rows: list[tuple[str, list[Cell | str]]] = []
        for column, sharpness in enumerate(SHARPNESS):
            cells: list[Cell | str] = []
            for method in METHODS:
                by_scene = values[:, outcome.of(method), column].mean(axis=1)
                # A run's objects share its particles: they are no independent trials.
                trials = RUNS_PER_SCENE * len(outcome.of(method))
                measured = rate(by_scene, trials) if measure == "success" else mean(by_scene)
                published = TABLE_1[measure].get(method)
                cells.append(Cell(published[column] if published else None, measured))
            rows.append((f"{sharpness:g}", cells))
        tables.append(
            Table(
                f"table_1_{measure}",
                f"Table 1, objects 2-7: {measure} (%)",
                ["sharpness", *METHODS],
                rows,
            )
        )
    return tables


def table_2(outcome: Outcome) -> list[Table]:
    """Recovery, precision and recall of object 1."""
    measures = {
        "recovery": outcome.recovered.mean(axis=-1),
        "precision": outcome.leader_precision,
        "recall": outcome.leader_recall,
    }
    notes = {
        "recovery": (
            "Worst and best are selected by chance too: of seven orders that were all alike, the "
            f"worst would show {_extremes(outcome)} at these sharpness values."
        ),
        "precision": "Over the frames in which object 1 is tracked, as in the paper.",
        "recall": "",
    }
    return [
        Table(
            f"table_2_{measure}",
            f"Table 2, object 1: {measure} (%)",
            ["sharpness", "Non-PS", "PS mean", "PS worst", "PS best", *METHODS[2:]],
            [
                (f"{sharpness:g}", _row_2(outcome, measure, values, column))
                for column, sharpness in enumerate(SHARPNESS)
            ],
            notes[measure],
        )
        for measure, values in measures.items()
    ]


def _row_2(outcome: Outcome, measure: str, values: np.ndarray, column: int) -> list[Cell | str]:
    """The cells of a row; worst and best order are those of the *recovery* rate."""
    orders = outcome.orders()
    recovery = outcome.recovered[:, orders, column].mean(axis=(0, 2))
    places = {
        "Non-PS": outcome.of("Non-PS"),
        "PS mean": orders,
        "PS worst": [orders[int(np.argmin(recovery))]],
        "PS best": [orders[int(np.argmax(recovery))]],
        **{method: outcome.of(method) for method in METHODS[2:]},
    }
    cells: list[Cell | str] = []
    for name, place in places.items():
        by_scene = values[:, place, column]
        if measure == "recovery":
            measured = rate(by_scene.mean(axis=1), RUNS_PER_SCENE * len(place))
        else:
            measured = mean(np.nanmean(by_scene, axis=1) if len(place) > 1 else by_scene[:, 0])
        published = TABLE_2[measure].get(name)
        figure = published[column] if published else None
        if name == "PS best" and measure == "recovery":
            figure = BEST_ORDER_RECOVERY.get(SHARPNESS[column])
        cells.append(Cell(figure, measured))
    return cells


def shuffled_orders(recovered: np.ndarray, count: int = 2000, seed: int = 0) -> np.ndarray:
    """Rates per order if orders did not matter, ``[count, K]``, by permutation.

    Args:
        recovered: ``[S, K, R]`` bool, by scene, order and run.  Within a run on a scene the
            orders' outcomes are exchangeable if the order does not matter.
        count: permutations.
        seed: of the permutations.
    """
    blocks = np.moveaxis(np.asarray(recovered, float), 1, -1).reshape(-1, recovered.shape[1])
    rng = np.random.default_rng(seed)
    rates = []
    for _ in range(0, count, _CHUNK):
        shuffle = rng.random((_CHUNK, *blocks.shape)).argsort(axis=-1)
        rates.append(np.take_along_axis(blocks[None], shuffle, axis=-1).mean(axis=1))
    return np.concatenate(rates)[:count]


def order_p_value(recovered: np.ndarray) -> float:
    """Share of the permutations whose rates vary at least as much as ours, ``[S, K, R]``."""
    ours = float(np.var(recovered.mean(axis=(0, 2))))
    chance = shuffled_orders(recovered).var(axis=1)
    return float((1 + np.sum(chance >= ours - 1e-12)) / (1 + len(chance)))


def _extremes(outcome: Outcome) -> str:
    pieces = []
    for column in range(len(SHARPNESS)):
        chance = 100 * shuffled_orders(outcome.recovered[:, outcome.orders(), column])
        pieces.append(
            f"{chance.min(axis=1).mean():.0f} and the best {chance.max(axis=1).mean():.0f}"
        )
    return ", ".join(pieces)


def uniqueness_table(outcome: Outcome) -> Table:
    """Uniqueness by stage of PS, over all orders, at the first sharpness; and DPS's range."""
    stages = []
    for stage in range(NUM_OBJECTS):
        by_scene = [
            outcome.uniqueness[:, place, 0, (shift + stage) % NUM_OBJECTS]
            for shift, place in enumerate(outcome.orders())
        ]
        stages.append(np.mean(by_scene, axis=0))
    published = [FIRST_STAGE_UNIQUENESS] + [None] * (NUM_OBJECTS - 1)
    cells: list[Cell | str] = [
        Cell(figure, mean(values), digits=1)
        for figure, values in zip(published, stages, strict=True)
    ]
    distributed: list[Cell | str] = [
        Cell(None, mean(outcome.uniqueness[:, outcome.of("DPS")[0], 0, place]), digits=1)
        for place in range(NUM_OBJECTS)
    ]
    return Table(
        "uniqueness",
        f"Section 3.3: uniqueness (%) at sharpness {SHARPNESS[0]:g}",
        ["", *(str(k + 1) for k in range(NUM_OBJECTS))],
        [("PS, by stage", cells), ("DPS, by object", distributed)],
    )


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
    """Recovery of object 1: rates, differences to PS scene by scene, and PS's orders."""
    figure, axes = plotting.new_figure(1, 3, figsize=(15, 4.8))
    rates, differences, orders = axes[0]
    recovered = outcome.recovered.mean(axis=-1)
    for place, (method, colour) in enumerate(
        zip(METHODS, plotting.colours(len(METHODS)), strict=True)
    ):
        by_scene = recovered[:, outcome.of(method)].mean(axis=1)  # [S, L]
        at = np.array(SHARPNESS) + (place - 2) * 1.2
        trials = RUNS_PER_SCENE * len(outcome.of(method))
        _points(rates, at, [rate(column, trials) for column in by_scene.T], colour, method)
        published = TABLE_2["recovery"].get("PS mean" if method == "PS" else method)
        if published:
            rates.plot(at, published, "x", color=colour, ms=9, mew=2)
        if method == "PS":
            continue
        gaps = 100 * (by_scene - recovered[:, outcome.orders()].mean(axis=1))
        cells = [Measured(float(gap.mean()), *student_interval(gap)(0.95)) for gap in gaps.T]
        _points(differences, at, cells, colour, method)
        if published:
            gap = np.subtract(published, TABLE_2["recovery"]["PS mean"])
            differences.plot(at, gap, "x", color=colour, ms=9, mew=2)
    rates.set(ylabel="object 1 recovered (% of runs)", ylim=(0, 100))
    differences.set(ylabel="points above the mean of PS's orders, by scene")
    differences.axhline(0, color="gray", lw=1)
    for axis in (rates, differences):
        axis.set(xlabel="sharpness (crosses: published)", xticks=SHARPNESS)
        axis.grid(alpha=0.3)
    pooled = recovered[:, outcome.orders()].mean(axis=-1)  # [S, K], over sharpness values
    gaps = 100 * (pooled - pooled.mean(axis=1, keepdims=True))
    cells = [Measured(float(gap.mean()), *student_interval(gap)(0.95)) for gap in gaps.T]
    _points(orders, np.arange(1, NUM_OBJECTS + 1), cells, "black", "PS")
    orders.axhline(0, color="gray", lw=1)
    orders.set(
        xlabel="object that PS treats first",
        ylabel="points above the mean of PS's orders, all sharpness",
        ylim=(-30, 30),
    )
    orders.grid(alpha=0.3)
    figure.legend(*rates.get_legend_handles_labels(), loc="outside upper center", ncols=5)
    return figure


def _points(axis: Any, at: Any, cells: Sequence[Measured], colour: Any, label: str) -> None:
    value, low, high = np.array(cells).T
    errors = np.clip([value - low, high - value], 0, None)
    axis.errorbar(at, value, errors, fmt="o", color=colour, capsize=3, label=label)
