"""Recovery against the distance to which the distracter leads the trackers."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from jaxpf.experiments.claims import Measured
from jaxpf.experiments.comparison_table import Cell, Table
from jaxpf.experiments.smith2004.synthetic import (
    METHODS,
    RUNS_PER_SCENE,
    SCENE,
    Outcome,
    measure,
)
from jaxpf.experiments.smith2004.tables import rate
from jaxpf.media import plotting

#: Pixels between object 1 and the distracter in the last frame that shows it.
DISTANCES = (15.0, 22.0, 30.0, 40.0, 50.0)


class Sweep(NamedTuple):
    """Recovery of object 1 at several distances, over all sharpness values.

    Attributes:
        distances: ``[K]``.
        rates: method -> one figure per distance.
        num_scenes: for each distance.
    """

    distances: tuple[float, ...]
    rates: dict[str, list[Measured]]
    num_scenes: int


def sweep(
    seeds: Sequence[int],
    distances: Sequence[float] = DISTANCES,
    known: Outcome | None = None,
    progress: Callable[[int], None] = lambda done: None,
) -> Sweep:
    """Measure recovery at every distance.

    Args:
        seeds: of the scenes.
        distances: values of the scene's ``lead_distance``.
        known: an outcome at ``SCENE``'s own distance whose scenes begin with ``seeds``.
        progress: called with the number of scenes done.
    """
    rates: dict[str, list[Measured]] = {method: [] for method in METHODS}
    finished = 0

    def one_more(_: int) -> None:
        nonlocal finished
        finished += 1
        progress(finished)

    for distance in distances:
        if known is not None and distance == SCENE["lead_distance"]:
            outcome = known
        else:
            outcome = measure(seeds, {**SCENE, "lead_distance": distance}, progress=one_more)
        for method in METHODS:
            # All sharpness values of a run count as one trial: they share scene and key.
            by_scene = outcome.recovered[: len(seeds), outcome.of(method)].mean(axis=(1, 2, 3))
            rates[method].append(rate(by_scene, RUNS_PER_SCENE * len(outcome.of(method))))
    return Sweep(tuple(distances), rates, len(seeds))


def sweep_table(result: Sweep) -> Table:
    """A row for every distance."""
    rows: list[tuple[str, list[Cell | str]]] = [
        (f"{distance:g}", [Cell(None, result.rates[method][place]) for method in METHODS])
        for place, distance in enumerate(result.distances)
    ]
    return Table(
        "sweep",
        "Recovery of object 1 (%) by the distance to which the distracter leads, all sharpness "
        "values",
        ["pixels", *METHODS],
        rows,
        f"{result.num_scenes} scenes with {RUNS_PER_SCENE} runs each at every distance.",
    )


def sweep_figure(result: Sweep) -> Any:
    """Recovery with intervals against distance, one line per method."""
    figure, axes = plotting.new_figure(figsize=(9, 4.5))
    axis = axes[0, 0]
    colours = plotting.colours(len(METHODS))
    for k, (method, colour) in enumerate(zip(METHODS, colours, strict=True)):
        value, low, high = np.array(result.rates[method]).T
        errors = np.clip([value - low, high - value], 0, None)
        at = np.array(result.distances) + (k - 2) * 0.4
        axis.errorbar(at, value, errors, marker="o", color=colour, capsize=3, label=method)
    axis.set(
        xlabel="distance to which the distracter leads (pixels)",
        ylabel="object 1 recovered (% of runs)",
        ylim=(0, 100),
    )
    axis.grid(alpha=0.3)
    figure.legend(loc="outside right center")
    return figure
