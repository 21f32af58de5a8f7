"""What the paper concludes from tables 1 and 2 and figure 4, judged by our runs.

Differences between methods are taken scene by scene (common scenes and seeds), so their
intervals allow for scenes that are harder than others.
"""

from collections.abc import Iterator

import numpy as np

from jaxpf.experiments.claims import Claim, Quantity, judged, student_interval
from jaxpf.experiments.smith2004.published import (
    FIRST_STAGE_UNIQUENESS,
    SHARPNESS,
    TABLE_1,
    TABLE_2,
)
from jaxpf.experiments.smith2004.synthetic import NUM_OBJECTS, Outcome
from jaxpf.experiments.smith2004.tables import order_p_value

#: Two methods are on a par if they differ by less than this, in points of precision or recall.
ON_A_PAR = 3.0
#: "Far below": the best order beats the worst by at least this many points of recovery.
FAR_BELOW = 10.0


def claims(outcome: Outcome) -> list[Claim]:
    """All claims with their verdicts."""
    return [*_easy_objects(outcome), *_object_1(outcome), *_impoverishment(outcome)]


def difference(
    outcome: Outcome, values: np.ndarray, first: str, second: str, **claimed: float
) -> list[Quantity]:
    """``first - second`` at every sharpness, in points; ``values`` ``[S, O, L]``, 0 to 1."""
    by_scene = 100 * (
        values[:, outcome.of(first)].mean(axis=1) - values[:, outcome.of(second)].mean(axis=1)
    )
    return [
        _quantity(f"{sharpness:g}", by_scene[:, column], **claimed)
        for column, sharpness in enumerate(SHARPNESS)
    ]


def _quantity(what: str, by_scene: np.ndarray, **claimed: float) -> Quantity:
    value = float(np.nanmean(by_scene)) if np.any(np.isfinite(by_scene)) else float("nan")
    return Quantity(what, value, student_interval(by_scene), **claimed)


def _cells(table: dict[str, tuple[float, ...]], *methods: str) -> str:
    return "; ".join(
        f"{method} {', '.join(f'{cell:g}' for cell in table[method])}" for method in methods
    )


def _easy_objects(outcome: Outcome) -> Iterator[Claim]:
    success, precision = TABLE_1["success"], TABLE_1["precision"]
    yield judged(
        "PS tracks the easy objects throughout more often than the plain filter",
        "3.2, table 1",
        _cells(success, "Non-PS", "PS"),
        difference(outcome, outcome.success, "PS", "Non-PS", at_least=0),
    )
    yield judged(
        "PS is more precise on them than the plain filter, by some 22 points",
        "3.2, table 1",
        _cells(precision, "Non-PS", "PS"),
        difference(outcome, outcome.precision, "PS", "Non-PS", at_least=0),
    )
    yield judged(
        "and recalls more of them, by some 20 points",
        "3.2, table 1",
        _cells(TABLE_1["recall"], "Non-PS", "PS"),
        difference(outcome, outcome.recall, "PS", "Non-PS", at_least=0),
    )
    yield judged(
        f"On the easy objects DPS is on a par with PS (within {ON_A_PAR:g} points of precision)",
        "5.1, table 1",
        _cells(precision, "PS", "DPS"),
        difference(outcome, outcome.precision, "DPS", "PS", at_least=-ON_A_PAR, at_most=ON_A_PAR),
        digits=1,
    )


def _object_1(outcome: Outcome) -> Iterator[Claim]:
    recovery = TABLE_2["recovery"]
    recovered = outcome.recovered.mean(axis=-1)
    yield judged(
        "PS, on average over its orders, recovers object 1 more often than the plain filter",
        "3.3, table 2",
        _cells(recovery, "Non-PS", "PS mean"),
        difference(outcome, recovered, "PS", "Non-PS", at_least=0),
    )
    yield judged(
        "DPS recovers it more often than PS on average, at every sharpness",
        "5.1, table 2",
        _cells(recovery, "PS mean", "DPS"),
        difference(outcome, recovered, "DPS", "PS", at_least=0),
    )
    averaged = _averaged(outcome, recovered)
    yield judged(
        "and so over the four sharpness values together",
        "5.1, table 2",
        f"DPS - PS {_mean_gap(recovery):.1f}",
        [_quantity("", averaged, at_least=0)],
    )
    yield _orders(outcome)
    for measure, values in (
        ("precision", outcome.leader_precision),
        ("recall", outcome.leader_recall),
    ):
        yield judged(
            f"DPS's {measure} of object 1 is above PS's, averaged over the sharpness values",
            "5.1, table 2",
            f"DPS - PS {_mean_gap(TABLE_2[measure]):.1f}",
            [_quantity("", _averaged(outcome, values), at_least=0)],
            digits=1,
        )


def _averaged(outcome: Outcome, values: np.ndarray) -> np.ndarray:
    """DPS minus the mean of PS, over all sharpness values, by scene, in points."""
    dps = np.nanmean(values[:, outcome.of("DPS")], axis=(1, 2))
    return 100 * (dps - np.nanmean(values[:, outcome.orders()], axis=(1, 2)))


def _mean_gap(table: dict[str, tuple[float, ...]]) -> float:
    return float(np.mean(table["DPS"]) - np.mean(table["PS mean"]))


def _orders(outcome: Outcome) -> Claim:
    """Best against worst order, free of the luck of having been selected.

    The best and the worst order are chosen on all scenes but one, and compared on that one.
    """
    recovered = outcome.recovered[:, outcome.orders()]
    rates = recovered.mean(axis=-1)  # [S, K, L]
    gaps = np.full((rates.shape[0], rates.shape[2]), np.nan)
    if len(rates) > 1:
        for scene in range(len(rates)):
            others = np.delete(rates, scene, axis=0).mean(axis=0)
            for column in range(rates.shape[2]):
                best, worst = np.argmax(others[:, column]), np.argmin(others[:, column])
                gaps[scene, column] = rates[scene, best, column] - rates[scene, worst, column]
    parts = [
        _quantity(f"{sharpness:g}", 100 * gaps[:, column], at_least=FAR_BELOW)
        for column, sharpness in enumerate(SHARPNESS)
    ]
    claim = judged(
        f"The worst order of PS is far below the best (by {FAR_BELOW:g} points or more)",
        "3.3, table 2",
        f"{_cells(TABLE_2['recovery'], 'PS worst')}; best 38 at 30",
        parts,
    )
    chance = ", ".join(f"{order_p_value(recovered[:, :, k]):.2f}" for k in range(len(SHARPNESS)))
    return claim._replace(
        measured=f"{claim.measured}; p that seven equal orders differ as much: {chance}"
    )


def _impoverishment(outcome: Outcome) -> Iterator[Claim]:
    """At the first sharpness, as in figure 4."""
    uniqueness = outcome.uniqueness[:, :, 0]  # [S, O, P]
    dynamics = outcome.dynamics[:, :, 0, :, :].mean(axis=-1)  # u and v
    by_stage = np.stack(
        [
            [
                uniqueness[:, place, (shift + stage) % NUM_OBJECTS]
                for shift, place in enumerate(outcome.orders())
            ]
            for stage in (0, NUM_OBJECTS - 1)
        ]
    ).mean(axis=1)  # [2, S]
    yield judged(
        "Few distinct particles are left of the object in PS's first stage (half to twice 1.99 %)",
        "3.3",
        f"{FIRST_STAGE_UNIQUENESS} %",
        [
            _quantity(
                "",
                100 * by_stage[0],
                at_least=FIRST_STAGE_UNIQUENESS / 2,
                at_most=2 * FIRST_STAGE_UNIQUENESS,
            )
        ],
        digits=1,
    )
    order = outcome.orders()[0]
    last = NUM_OBJECTS - 1
    yield judged(
        "Effective dynamics shrink from the last stage of PS to the earlier ones (object 7 - 2)",
        "3.3, figure 4",
        "in the figure",
        [_quantity("", 100 * (dynamics[:, order, last] - dynamics[:, order, 1]), at_least=0)],
    )
    easy = slice(1, None)  # object 1 is spread by the distracter as well
    dps = outcome.of("DPS")[0]
    yield judged(
        "DPS shares the burden: uniqueness and effective dynamics of objects 2-7 range less than "
        "in PS (PS's range - DPS's)",
        "5.1, figure 4",
        "in the figure",
        [
            _quantity(
                what,
                100 * (np.ptp(values[:, order, easy], 1) - np.ptp(values[:, dps, easy], 1)),
                at_least=0,
            )
            for what, values in (("uniqueness", uniqueness), ("dynamics", dynamics))
        ],
    )
