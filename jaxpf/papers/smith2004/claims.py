"""The figures that judge the paper's claims, by the claims' keys.

Methods are compared scene by scene, on common scenes and seeds.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from jaxpf.papers.judging.claims import Quantity
from jaxpf.papers.judging.estimates import gap_of, mean_of
from jaxpf.papers.smith2004.measure import Measurement
from jaxpf.papers.smith2004.orders import best_and_worst
from jaxpf.papers.smith2004.published import BEST_ORDER_RECOVERY, SHARPNESS
from jaxpf.papers.smith2004.scenes import NUM_OBJECTS, Outcome

Quantities = dict[str, list[Quantity]]


def quantities(measured: Measurement) -> Quantities:
    """Key of a claim -> its figures."""
    return of_scenes(measured.outcome)


def of_scenes(outcome: Outcome) -> Quantities:
    """Figures of tables 1 and 2, and of figure 4."""
    recovered = outcome.recovered.mean(axis=-1)
    dps, ps = _averages(outcome, recovered)
    return {
        "easy_success": _rates(outcome, outcome.success, "PS", "Non-PS"),
        "easy_precision": _differences(outcome, outcome.precision, "PS", "Non-PS"),
        "easy_recall": _differences(outcome, outcome.recall, "PS", "Non-PS"),
        "easy_on_a_par": [
            part._replace(what=f"{name}, {part.what}")
            for name in ("precision", "recall")
            for part in _differences(outcome, getattr(outcome, name), "DPS", "PS")
        ],
        "ps_recovers": _rates(outcome, recovered, "PS", "Non-PS"),
        "dps_recovers_each": _rates(outcome, recovered, "DPS", "PS"),
        "dps_recovers": [gap_of(dps, ps)],
        "orders": _orders(outcome),
        "dps_quality": [
            mean_of(_averaged(outcome, outcome.leader_precision), "precision"),
            mean_of(_averaged(outcome, outcome.leader_recall), "recall"),
        ],
        **_impoverishment(outcome),
    }


def _pairs(outcome: Outcome, values: np.ndarray, *methods: str) -> Iterator[tuple[Any, ...]]:
    """Two methods' values ``[S, 1]`` and the sharpness as text; ``values`` are ``[S, O, L]``."""
    first, second = (values[:, outcome.of(method)].mean(axis=1).T for method in methods)
    for one, other, sharpness in zip(first, second, SHARPNESS, strict=True):
        yield one[:, None], other[:, None], f"{sharpness:g}"


def _rates(outcome: Outcome, values: np.ndarray, *methods: str) -> list[Quantity]:
    """``first - second`` of rates at every sharpness, in points."""
    return [gap_of(*pair) for pair in _pairs(outcome, values, *methods)]


def _differences(outcome: Outcome, values: np.ndarray, *methods: str) -> list[Quantity]:
    """``first - second`` of mean shares, which hardly differ between scenes."""
    return [
        mean_of(100 * (one - other)[:, 0], name)
        for one, other, name in _pairs(outcome, values, *methods)
    ]


def _averages(outcome: Outcome, values: np.ndarray) -> list[np.ndarray]:
    """DPS and the mean over PS's orders, ``[S, 1]`` each, over all sharpness values."""
    places = outcome.of("DPS"), outcome.orders()
    return [np.nanmean(values[:, place], axis=(1, 2))[:, None] for place in places]


def _averaged(outcome: Outcome, values: np.ndarray) -> np.ndarray:
    dps, ps = _averages(outcome, values)
    return 100 * (dps - ps)[:, 0]


def _orders(outcome: Outcome) -> list[Quantity]:
    """Best minus worst order of PS, chosen on half of the scenes and compared on the other half.

    At the sharpness values with a published best order.
    """
    best, worst = best_and_worst(outcome.recovered[:, outcome.orders()].mean(axis=-1))
    columns = map(SHARPNESS.index, BEST_ORDER_RECOVERY)
    return [gap_of(best[:, [column]], worst[:, [column]]) for column in columns]


def _impoverishment(outcome: Outcome) -> Quantities:
    """Impoverishment at the first sharpness, as in figure 4."""
    uniqueness = outcome.uniqueness[:, :, 0]  # [S, O, P]
    dynamics = outcome.dynamics[:, :, 0].mean(axis=-1)  # of u and v
    orders, dps, last = outcome.orders(), outcome.of("DPS")[0], NUM_OBJECTS - 1
    first_stage = [uniqueness[:, place, shift] for shift, place in enumerate(orders)]

    def evened(values: np.ndarray) -> list[Quantity]:
        """Range over objects 2 to P under PS minus under DPS; the distracter spreads object 1."""
        ps, other = (np.ptp(values[:, place, 1:], axis=1) for place in (orders[0], dps))
        return [mean_of(100 * (ps - other))]

    shrinks = dynamics[:, orders[0], last] - dynamics[:, orders[0], 1]
    return {
        "first_stage": [mean_of(100 * np.mean(first_stage, axis=0))],
        "dynamics_shrink": [mean_of(100 * shrinks)],
        "even_uniqueness": evened(uniqueness),
        "even_dynamics": evened(dynamics),
    }
