"""What the paper concludes, judged by our runs, and how many runs would settle the rest."""

import math
from collections.abc import Callable, Iterator

import numpy as np

from jaxpf.experiments.claims import (
    CANNOT_RESOLVE,
    Claim,
    Quantity,
    cluster_interval,
    judged,
    newcombe,
    student_interval,
)
from jaxpf.experiments.rowe2005 import published, tables
from jaxpf.experiments.rowe2005.synthetic import RUNS_PER_SCENE, Outcome

#: "Negligible": at most this percentage of the samples is lost.
NEGLIGIBLE = 5.0
#: "Collapse": boxes end with at most this share of their true side.
COLLAPSED = 0.5


def claims(outcome: Outcome, crossing: Outcome) -> list[Claim]:
    """All claims with their verdicts; ``crossing`` are the runs on targets that cross."""
    return [
        *_shares(outcome),
        *_errors(outcome),
        *_likelihood(outcome, crossing),
        *_sizes(outcome),
    ]


def _judged(
    statement: str, source: str, figures: str, parts: list[Quantity], digits: int = 0
) -> Claim:
    """A claim that says, where it cannot be resolved, what would resolve it."""
    claim = judged(statement, source, figures, parts, digits=digits)
    if claim.verdict != CANNOT_RESOLVE:
        return claim
    needed = max(runs_to_resolve(part) for part in parts)
    remedy = (
        f"about {needed:.0f} runs would resolve it"
        if math.isfinite(needed)
        else "no number of runs would resolve it"
    )
    return claim._replace(measured=f"{claim.measured}; {remedy}")


def runs_to_resolve(part: Quantity) -> float:
    """Runs after which the interval would reach as far as the nearest end of the claimed range.

    From how far it reaches now, if the figure stays where it is.
    """
    value, low, high = part.measured()
    ends = [end for end in (part.at_least, part.at_most) if math.isfinite(end)]
    distance = min((abs(value - end) for end in ends), default=math.nan)
    scenes = getattr(part.interval, "scenes", math.nan)
    if not distance > 0:
        return math.inf
    return scenes * RUNS_PER_SCENE * ((high - low) / 2 / distance) ** 2


class _Interval:
    """Intervals that know from how many scenes they are."""

    def __init__(self, interval: Callable[[float], tuple[float, float]], scenes: int) -> None:
        self.interval, self.scenes = interval, scenes

    def __call__(self, level: float) -> tuple[float, float]:
        return self.interval(level)


def _mean(what: str, by_scene: np.ndarray, **claimed: float) -> Quantity:
    """A mean over the scenes ``[S]``; scenes that are NaN are left out."""
    finite = by_scene[np.isfinite(by_scene)]
    value = float(finite.mean()) if len(finite) else float("nan")
    return Quantity(what, value, _Interval(student_interval(by_scene), len(finite)), **claimed)


def _rate(what: str, values: np.ndarray, **claimed: float) -> Quantity:
    """A percentage of trials ``[S, trials]`` bool."""
    by_scene = values.mean(axis=1)
    interval = cluster_interval(by_scene, values.shape[1])
    return Quantity(what, 100 * float(by_scene.mean()), _Interval(interval, len(values)), **claimed)


def _difference(what: str, first: np.ndarray, second: np.ndarray, **claimed: float) -> Quantity:
    """The difference of two percentages of trials ``[S, trials]``, scene by scene, in points.

    Where all scenes differ alike nothing is seen of their variance: then each is one trial.
    """
    by_scene = 100 * (first.mean(axis=1) - second.mean(axis=1))
    if np.ptp(by_scene) > 0:
        return _mean(what, by_scene, **claimed)
    number = len(by_scene)
    rates = float(first.mean()) * number, float(second.mean()) * number
    interval = _Interval(newcombe(rates, (number, number)), number)
    return Quantity(what, float(by_scene[0]), interval, **claimed)


def _shares(outcome: Outcome) -> Iterator[Claim]:
    low, high = published.SHARE_BAND
    yield _judged(
        "Without eq. 4 the tracker loses a target for lack of samples (in most runs)",
        "4, figure 2 (a)",
        "one run shown",
        [
            _rate(
                "runs with a starved target, %",
                tables.starved(outcome, "without eq. 4"),
                at_least=50,
            )
        ],
    )
    yield _judged(
        "With eq. 4 each target keeps half of the samples, 49.5 to 50.5 %",
        "4, figure 2 (b)",
        f"{low:g} to {high:g} in each run",
        [
            _mean(
                "share of target 1, %",
                tables.run_share(outcome, "both").mean(axis=1),
                at_least=low,
                at_most=high,
            )
        ],
        digits=2,
    )
    yield _judged(
        "and no target is ever starved (in at most 5 % of runs)",
        "4, figure 2 (b)",
        "none",
        [
            _rate("starved with eq. 4, %", tables.starved(outcome, "both"), at_most=5),
            _difference(
                "without eq. 4 - with it, points",
                tables.starved(outcome, "without eq. 4"),
                tables.starved(outcome, "both"),
                at_least=0,
            ),
        ],
    )


def _errors(outcome: Outcome) -> Iterator[Claim]:
    off, on = (published.tracked_mean(variant) for variant in ("neither", "both"))
    yield _judged(
        "Regularising and speed feedback reduce the error of the targets that are tracked",
        "4, table 1",
        f"{off:.3f} to {on:.3f}",
        [
            _mean(
                "neither - both",
                tables.tracked_error(outcome, "neither") - tables.tracked_error(outcome, "both"),
                at_least=0,
            )
        ],
        digits=4,
    )
    yield _judged(
        "and targets are lost less often",
        "4, table 1",
        "2 of 8 to 0 of 8",
        [
            _difference(
                "neither - both, points",
                tables.lost(outcome, "neither"),
                tables.lost(outcome, "both"),
                at_least=0,
            )
        ],
        digits=1,
    )
    yield _judged(
        "With both no target is ever lost (in at most 5 % of cases)",
        "4, table 1",
        "0 of 8",
        [_rate("lost, %", tables.lost(outcome, "both"), at_most=5)],
        digits=1,
    )
    yield _judged(
        "They reduce the number of lost samples",
        "4, figure 3",
        "figure",
        [
            _mean(
                "neither - both, points",
                tables.astray(outcome, "neither") - tables.astray(outcome, "both"),
                at_least=0,
            )
        ],
        digits=1,
    )
    yield _judged(
        f"to a negligible number (at most {NEGLIGIBLE:g} %)",
        "4, figure 3",
        '"negligible"',
        [_mean("both, %", tables.astray(outcome, "both"), at_most=NEGLIGIBLE)],
        digits=1,
    )


def _likelihood(outcome: Outcome, crossing: Outcome) -> Iterator[Claim]:
    for where, found in (
        ("before strips that mimic them", outcome),
        ("that hide each other", crossing),
    ):
        yield _judged(
            f"The mean of the pixels' densities loses fewer targets {where} than their product",
            "3, 3.1 (argued)",
            "–",
            [
                _difference(
                    "product - mean, points",
                    tables.lost(found, "product"),
                    tables.lost(found, "both"),
                    at_least=0,
                )
            ],
            digits=1,
        )


def _sizes(outcome: Outcome) -> Iterator[Claim]:
    yield _judged(
        "Without the size term boxes shrink more than with it",
        "3.4",
        '"empirically proved"',
        [
            _mean(
                "side, with - without",
                tables.last_ratio(outcome, "both")
                - tables.last_ratio(outcome, "without size term"),
                at_least=0,
            )
        ],
        digits=2,
    )
    yield _judged(
        f"and eventually collapse (to at most {COLLAPSED:g} of their side)",
        "3.4",
        '"eventually, collapse"',
        [
            _mean(
                "side over true side, without",
                tables.last_ratio(outcome, "without size term"),
                at_most=COLLAPSED,
            )
        ],
        digits=2,
    )
