"""Measures of the experiment, by the names in ``claims.csv``; variants are methods.

Most have a case for each sharpness.  Shares are ``[S, n]``, of the n orderings of a method.
"""

from collections.abc import Callable, Mapping
from functools import partial

import numpy as np

from jaxpf.papers.judging.measures import Measure
from jaxpf.papers.smith2004.orders import best_and_worst
from jaxpf.papers.smith2004.published import BEST_GIVEN_AT, SHARPNESS
from jaxpf.papers.smith2004.scenes import NUM_OBJECTS, Outcome

Cases = dict[str, np.ndarray]
_BEST, _WORST = "PS best", "PS worst"


def shares(outcome: Outcome, variant: str, field: str = "recovered") -> Cases:
    """Shares at each sharpness; the best and the worst order of PS are those by recovery."""
    cases = {}
    for column, sharpness in enumerate(SHARPNESS):
        recovered = outcome.recovered[:, :, column].mean(axis=-1)
        places = outcome.of("PS" if variant in (_BEST, _WORST) else variant)
        if variant in (_BEST, _WORST):
            rates = recovered[:, places].mean(axis=0)
            places = [places[int(rates.argmax() if variant == _BEST else rates.argmin())]]
        values = recovered if field == "recovered" else getattr(outcome, field)[:, :, column]
        cases[f"{sharpness:g}"] = values[:, places]
    return cases


def _shares(field: str) -> Measure:
    return Measure(partial(shares, field=field), "percent")


def _mean(values: np.ndarray) -> np.ndarray:
    """``[S]``, per cent, of shares; NaN where none is known."""
    return 100 * np.ma.masked_invalid(values).mean(axis=1).filled(np.nan)


def _means(field: str) -> Callable[[Outcome, str], Cases]:
    return lambda outcome, variant: {
        what: _mean(each) for what, each in shares(outcome, variant, field).items()
    }


def _both(outcome: Outcome, variant: str) -> Cases:
    return {
        f"{field}, {sharpness}": values
        for field in ("precision", "recall")
        for sharpness, values in _means(field)(outcome, variant).items()
    }


def _at_every_sharpness(outcome: Outcome, variant: str, field: str) -> np.ndarray:
    """Shares of a method's orderings at all sharpness values."""
    return np.concatenate(list(shares(outcome, variant, field).values()), axis=1)


def _leader(outcome: Outcome, variant: str) -> Cases:
    return {
        what: _mean(_at_every_sharpness(outcome, variant, f"leader_{what}"))
        for what in ("precision", "recall")
    }


def _chosen(outcome: Outcome, variant: str, columns: slice = slice(None)) -> np.ndarray:
    """Shares of half of the scenes, under PS's best or worst order of the other half."""
    rates = outcome.recovered[:, outcome.of("PS"), columns].mean(axis=(2, 3))
    return best_and_worst(rates)[(_BEST, _WORST).index(variant)][:, None]


def _by_stage(outcome: Outcome, stage: str) -> np.ndarray:
    """Shares under PS that comes to object 1 at a stage, from 1: the order shifted by 1 - stage."""
    shift = (1 - int(stage)) % NUM_OBJECTS
    return outcome.recovered[:, outcome.of("PS")[shift]].mean(axis=-1)


def _uniqueness(outcome: Outcome, variant: str) -> Cases:
    """Per cent at the first sharpness: of PS by stage, over all orders, else by object."""
    places = outcome.of(variant)
    # Object (shift + stage) stands at that stage of the order that begins with ``shift``.
    shifts = np.arange(len(places))
    return {
        f"{stage + 1}": _mean(outcome.uniqueness[:, places, 0, (shifts + stage) % NUM_OBJECTS])
        for stage in range(NUM_OBJECTS)
    }


def _by_object(outcome: Outcome, variant: str, field: str) -> np.ndarray:
    """``[S, P - 1]``, per cent at the first sharpness, without object 1, which is distracted.

    Of PS in its first order; of dynamics the mean of u and v.
    """
    values = 100 * getattr(outcome, field)[:, outcome.of(variant)[0], 0, 1:]
    return values.mean(axis=-1) if field == "dynamics" else values


def _range(field: str) -> Measure:
    return Measure(lambda outcome, variant: np.ptp(_by_object(outcome, variant, field), axis=1))


def _shrinking(outcome: Outcome, variant: str) -> np.ndarray:
    dynamics = _by_object(outcome, variant, "dynamics")
    return dynamics[:, -1] - dynamics[:, 0]


MEASURES: Mapping[str, Measure] = {
    "success": _shares("success"),
    "precision": Measure(_means("precision")),
    "recall": Measure(_means("recall")),
    "precision and recall": Measure(_both),
    "recovery": _shares("recovered"),
    "recovery at every sharpness": Measure(
        partial(_at_every_sharpness, field="recovered"), "percent"
    ),
    "recovery of chosen orders": Measure(_chosen, "percent"),
    "recovery of chosen orders at 30": Measure(
        partial(_chosen, columns=slice(BEST_GIVEN_AT, BEST_GIVEN_AT + 1)), "percent"
    ),
    "recovery by stage": Measure(_by_stage, "percent"),
    "precision, object 1": Measure(_means("leader_precision")),
    "recall, object 1": Measure(_means("leader_recall")),
    "quality, object 1": Measure(_leader),
    "uniqueness": Measure(_uniqueness, digits=1),
    "uniqueness, first stage": Measure(lambda *args: _uniqueness(*args)["1"]),
    "shrinking of dynamics": Measure(_shrinking),
    "range of uniqueness": _range("uniqueness"),
    "range of dynamics": _range("dynamics"),
}
