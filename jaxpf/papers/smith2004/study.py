"""smith2004 repeated: Smith and Gatica-Perez, "Order matters: a distributed sampling method for
multi-object tracking", BMVC 2004.

Tables 1 and 2 and figure 4 on distracter scenes.  Variants are methods; most measures have a case
for each sharpness.
"""

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from jaxpf.media import plotting
from jaxpf.papers.checkpoints import Measurements
from jaxpf.papers.paper import Paper
from jaxpf.papers.smith2004.scenes import (
    ENDINGS,
    METHODS,
    NUM_OBJECTS,
    PARTICLES,
    SHARPNESS,
    Outcome,
    measure,
    measure_conditions,
    order_name,
    shifted,
)
from jaxpf.papers.study import Study, Values

_BEST, _WORST = "PS best", "PS worst"
#: Measure -> field of the outcome, and factor: the first two are shares of successes.
_FIELDS = {
    "recovery": ("recovered", 1),
    "success": ("success", 1),
    "precision": ("precision", 100),
    "recall": ("recall", 100),
    "precision, object 1": ("leader_precision", 100),
    "recall, object 1": ("leader_recall", 100),
}
#: Place of the only sharpness, 30, at which section 3.3 gives the best order's recovery.
_BEST_GIVEN_AT = slice(1, 2)


def measure_all(seeds: range, quick: bool, measurements: Measurements) -> Study:
    """Run all measurements; the quick ones are of fewer conditions."""
    measurements.report(f"Tables 1 and 2: {len(seeds)} scenes")
    outcome = measure(seeds, measurements=measurements)
    measurements.report("Conditions under which the order may matter more")
    particles = PARTICLES[-1:] if quick else PARTICLES
    endings = ("as here", "stages counted twice") if quick else tuple(ENDINGS)
    return study_of(outcome, measure_conditions(seeds, particles, endings, measurements))


def study_of(outcome: Outcome, conditions: Mapping[str, Outcome]) -> Study:
    """Rows of the paper's scene, and of conditions under which the order may matter more."""
    values = {**_by_sharpness(outcome), **_by_object(outcome)}
    for method in METHODS:
        values["recovery at every sharpness", method, ""] = everywhere(outcome, method)
        for what in ("precision", "recall"):
            place = f"leader_{what}"
            values["quality, object 1", method, what] = 100 * everywhere(outcome, method, place)
    for variant, rates in zip((_BEST, _WORST), chosen_orders(outcome, _BEST_GIVEN_AT), strict=True):
        values["recovery of chosen orders at 30", variant, ""] = rates
    for condition, found in conditions.items():
        for method in ("PS", "DPS"):
            values["conditions: recovery", method, condition] = everywhere(found, method)
        for variant, rates in zip((_BEST, _WORST), chosen_orders(found), strict=True):
            values["conditions: best and worst order", variant, condition] = rates
        for stage in range(1, NUM_OBJECTS + 1):
            rates = by_stage(found, stage)
            values["conditions: stage of object 1", f"{stage}", condition] = rates
    return Study(values, outcome, {"extremes": _extremes(outcome)})


def _by_sharpness(outcome: Outcome) -> Values:
    """Means over a method's orderings; the best and the worst order of PS are those by recovery."""
    values: Values = {}
    orders = outcome.of("PS")
    for column, sharpness in enumerate(SHARPNESS):
        rates = _rates(outcome)[:, orders, column].mean(axis=0)
        places = {method: outcome.of(method) for method in METHODS}
        places |= {_BEST: [orders[rates.argmax()]], _WORST: [orders[rates.argmin()]]}
        places["PS mean"] = orders
        for name, (field, factor) in _FIELDS.items():
            rates = _rates(outcome, field)[:, :, column]
            for variant, of_variant in places.items():
                values[name, variant, f"{sharpness:g}"] = factor * _mean(rates[:, of_variant])
    for name in ("precision", "recall"):
        for variant, case in [key[1:] for key in values if key[0] == name]:
            values["precision and recall", variant, f"{name}, {case}"] = values[name, variant, case]
    return values


def _by_object(outcome: Outcome) -> Values:
    """Uniqueness and effective dynamics at the first sharpness, per cent.

    Uniqueness of PS is by stage, over all orders, else by object; ranges are of objects 2 to P, as
    object 1 is distracted, under PS's first order; of dynamics the mean of u and v.
    """
    values: Values = {}
    for method in METHODS:
        places = outcome.of(method)
        # Object (shift + stage) stands at that stage of the order that begins with ``shift``.
        shifts = np.arange(len(places))
        for stage in range(NUM_OBJECTS):
            unique = outcome.uniqueness[:, places, 0, (shifts + stage) % NUM_OBJECTS]
            values["uniqueness", method, f"{stage + 1}"] = 100 * _mean(unique)
        values["uniqueness, first stage", method, ""] = values["uniqueness", method, "1"]
        unique = 100 * outcome.uniqueness[:, places[0], 0, 1:]
        dynamics = (100 * outcome.dynamics[:, places[0], 0, 1:]).mean(axis=-1)
        values["range of uniqueness", method, ""] = np.ptp(unique, axis=1)
        values["range of dynamics", method, ""] = np.ptp(dynamics, axis=1)
        values["shrinking of dynamics", method, ""] = dynamics[:, -1] - dynamics[:, 0]
    return values


def everywhere(outcome: Outcome, method: str, field: str = "recovered") -> np.ndarray:
    """``[S]``, mean over a method's orderings and all sharpness values."""
    rates = _rates(outcome, field)[:, outcome.of(method)]
    return _mean(np.swapaxes(rates, 1, 2).reshape(len(rates), -1))


def chosen_orders(outcome: Outcome, columns: slice = slice(None)) -> list[np.ndarray]:
    """Shares of half of the scenes, under PS's best and worst order of the other half."""
    return best_and_worst(_rates(outcome)[:, outcome.of("PS"), columns].mean(axis=2))


def by_stage(outcome: Outcome, stage: int) -> np.ndarray:
    """``[S]``, under PS that comes to object 1 at a stage: the order shifted by 1 - stage."""
    shift = (1 - stage) % NUM_OBJECTS
    return _rates(outcome)[:, outcome.of("PS")[shift]].mean(axis=1)


def _rates(outcome: Outcome, field: str = "recovered") -> np.ndarray:
    """``[S, O, L]``, a field of the outcome."""
    return np.asarray(getattr(outcome, field), float)


def _mean(values: np.ndarray) -> np.ndarray:
    """``[S]``, the mean of ``[S, n]``; NaN where none is known."""
    return np.ma.masked_invalid(values).mean(axis=1).filled(np.nan)


def _extremes(outcome: Outcome) -> str:
    """Best and worst recovery in per cent of orders that are all alike, at each sharpness."""
    pieces = []
    for column in range(len(SHARPNESS)):
        recovered = _rates(outcome)[:, outcome.of("PS"), column]
        chance = 100 * shuffled_orders(recovered)
        worst, best = chance.min(axis=1).mean(), chance.max(axis=1).mean()
        pieces.append(f"{worst:.0f} and the best {best:.0f}")
    return ", ".join(pieces)


def shuffled_orders(recovered: np.ndarray) -> np.ndarray:
    """Rates per order if orders did not matter, ``[2000, K]``, by permutation.

    Args:
        recovered: ``[S, K]``, by scene and order.  On a scene the orders' outcomes are
            exchangeable if the order does not matter.
    """
    rng = np.random.default_rng(0)
    rates = []
    for _ in range(20):  # a hundred at a time, to limit memory
        shuffle = rng.random((100, *recovered.shape)).argsort(axis=-1)
        rates.append(np.take_along_axis(recovered[None], shuffle, axis=-1).mean(axis=1))
    return np.concatenate(rates)


def best_and_worst(rates: np.ndarray) -> list[np.ndarray]:
    """Rates of the best and the worst order on half of the scenes, chosen on the other half.

    This avoids selection bias.

    Args:
        rates: ``[S, K, ...]``, by scene and order.

    Returns:
        ``[S // 2, ...]`` each.
    """
    chosen_on, compared_on = rates[::2].mean(axis=0), rates[1::2]
    chosen = (pick(chosen_on, axis=0)[None, None] for pick in (np.argmax, np.argmin))
    return [np.take_along_axis(compared_on, which, axis=1)[:, 0] for which in chosen]


def figures(study: Study) -> dict[str, Figure]:
    """File-name stem -> figure."""
    return {"figure_4": figure_4(study.shown)}


def figure_4(outcome: Outcome) -> Figure:
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


PAPER = Paper("smith2004", measure_all, figures)
