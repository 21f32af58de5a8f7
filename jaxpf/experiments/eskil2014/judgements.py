"""What the paper concludes from its three sequences, judged by our runs."""

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from jaxpf.experiments.claims import Claim, Quantity, judged, student_interval
from jaxpf.experiments.eskil2014 import methods, published
from jaxpf.experiments.eskil2014.tables import Outcomes, by_scene, found_again, kept
from jaxpf.experiments.eskil2014.tracking import Outcome
from jaxpf.measures import points as measures

#: "All points": at most this many are missing on average.
_MISSING = 0.5
#: "An order of magnitude": a ratio between these.
_TENFOLD = 5.0, 20.0
#: "The great majority" of the frames.
_MAJORITY = 80.0


def claims(outcomes: Outcomes) -> list[Claim]:
    """All claims of the sequences that were run, with their verdicts."""
    found: list[Claim] = []
    for scene, judge in (("fish", _fish), ("skydivers", _skydivers), ("face", _face)):
        if scene in outcomes:
            found += list(judge(outcomes[scene]))
    return found


def speed_claims(rates: Mapping[str, Mapping[str, float]]) -> list[Claim]:
    """Of frames per second: sequence -> method -> rate."""

    def exact(what: str, value: float, **claimed: float) -> Quantity:
        return Quantity(what, value, lambda level: (value, value), **claimed)

    slower = [
        exact(name, 100 * (1 - rate[methods.PROPOSED] / rate[methods.PFFL]), at_most=30.0)
        for name, rate in rates.items()
    ]
    ahead = [
        exact(name, rate[methods.PROPOSED] / rate[methods.SPOT], at_least=1.0)
        for name, rate in rates.items()
        if methods.SPOT in rate
    ]
    made = [
        judged(
            "The proposed method (M = 10) is at most 30 % slower than PFFL (M = 50)",
            "4.3, table 3",
            "20.6, 13.0, 31.0 %",
            slower,
            digits=1,
        )
    ]
    if ahead:
        made.append(
            judged(
                "It is considerably faster than SPOT",
                "4.3, table 3",
                "19, 2.5, 4.0 times",
                ahead,
                digits=0,
            )
        )
    return made


def _quantity(what: str, values: np.ndarray, **claimed: float) -> Quantity:
    values = np.asarray(values, float)
    return Quantity(what, float(np.nanmean(values)), student_interval(values), **claimed)


def _error(frames: slice = slice(None)) -> Callable[[np.ndarray, np.ndarray], Any]:
    def measure(errors, visible):
        return 100 * measures.mean_error(errors[:, frames])

    return measure


def _less(outcome: Outcome, other: str, measure: Any) -> np.ndarray:
    """How much less the proposed method has than another, scene by scene."""
    return _differences(outcome, other, methods.PROPOSED, measure)


def _differences(outcome: Outcome, first: str, second: str, measure: Any) -> np.ndarray:
    """On the scenes that both were run on."""
    values = [by_scene(outcome, method, measure) for method in (first, second)]
    common = min(map(len, values))
    return values[0][:common] - values[1][:common]


def _fish(outcome: Outcome) -> Iterator[Claim]:
    num_points = len(outcome.names)
    for proposed in (methods.PROPOSED, "eskil2014 as printed"):
        if proposed in outcome.errors:
            yield judged(
                f"All points are at their places at the end (within {_MISSING:g}) [{proposed}]",
                "4.1, figure 2",
                f"{published.KEPT_PROPOSED} of 12",
                [_quantity("", by_scene(outcome, proposed, kept), at_least=num_points - _MISSING)],
                digits=1,
            )
    for pffl in (methods.PFFL, "PFFL as printed"):
        if pffl in outcome.errors:
            yield judged(
                f"PFFL keeps fewer points (proposed - PFFL) [{pffl}]",
                "4.1, figure 2",
                f"12 - {published.KEPT_PFFL}",
                [_quantity("", -_less(outcome, pffl, kept), at_least=0)],
                digits=1,
            )
    last = _error(slice(-10, None))
    ratio = by_scene(outcome, methods.PFFL, last) / by_scene(outcome, methods.PROPOSED, last)
    yield judged(
        "At the end PFFL's mean error is about ten times the proposed method's (5 to 20)",
        "4.1, figure 4",
        "about 10",
        [_quantity("", ratio, at_least=_TENFOLD[0], at_most=_TENFOLD[1])],
        digits=1,
    )
    if methods.SPOT in outcome.errors:
        yield judged(
            "SPOT keeps the structure to the end: its mean error there is below PFFL's",
            "4.1, figure 4",
            "in the figure",
            [
                _quantity(
                    "% of the length",
                    _differences(outcome, methods.PFFL, methods.SPOT, last),
                    at_least=0,
                )
            ],
            digits=1,
        )
    yield judged(
        "After an occlusion points converge to their places (90 % of them or more)",
        "4.1, figures 2 and 3",
        "all",
        [_quantity("%", 100 * by_scene(outcome, methods.PROPOSED, found_again), at_least=90.0)],
    )
    for ablation in ("without drift", "without shape"):
        if ablation in outcome.errors:
            yield judged(
                f"Both contributions help: the error grows {ablation}",
                "4.1",
                "not measured",
                [_quantity("% of the length", _less(outcome, ablation, _error()), at_least=0)],
                digits=2,
            )


def _skydivers(outcome: Outcome) -> Iterator[Claim]:
    largest = by_scene(
        outcome,
        methods.PROPOSED,
        lambda errors, visible: np.max(errors.mean(axis=(0, 2))),
    )
    yield judged(
        "The mean error over the points never exceeds a quarter of the body's length",
        "4.1, figure 7",
        f"{published.SKYDIVER_LARGEST}",
        [_quantity("largest", largest, at_most=published.SKYDIVER_LARGEST)],
        digits=2,
    )
    chosen = [outcome.names.index(name) for name in ("head", "left hand", "right hand")]
    below = by_scene(
        outcome,
        methods.PROPOSED,
        lambda errors, visible: (
            100 * measures.share_within(errors[..., chosen], published.SKYDIVER_MOSTLY)
        ),
    )
    yield judged(
        "Head and hands are within .2 of it in the great majority of frames (80 % or more)",
        "4.1, figure 6",
        "in the figure",
        [_quantity("%", below, at_least=_MAJORITY)],
    )
    for method in (methods.PFFL, methods.SPOT):
        after = published.PARTING[f"skydivers {method}"]
        if method in outcome.errors and outcome.visible.shape[1] > after:
            yield judged(
                f"{method} is lost from frame {after} on ({method}'s error - the proposed one's)",
                "4.1, figure 7",
                "in the figure",
                [
                    _quantity(
                        "% of the length",
                        _less(outcome, method, _error(slice(after, None))),
                        at_least=100 * published.SKYDIVER_LARGEST,
                    )
                ],
            )


def _face(outcome: Outcome) -> Iterator[Claim]:
    after = published.PARTING["face"]
    for method in (methods.PFFL, methods.SPOT):
        if method in outcome.errors and outcome.visible.shape[1] > after:
            yield judged(
                f"From frame {after} on the proposed method is more accurate than {method}",
                "4.2, figure 10",
                "in the figure",
                [
                    _quantity(
                        "% of the length",
                        _less(outcome, method, _error(slice(after, None))),
                        at_least=0,
                    )
                ],
                digits=2,
            )
    begin, end = published.SMILE
    if outcome.visible.shape[1] > end:
        corner = outcome.names.index("right lip corner")

        def corner_error(frames):
            return by_scene(
                outcome,
                methods.PROPOSED,
                lambda errors, visible: 100 * errors[:, frames, corner].mean(axis=1),
            )

        smiling, later = corner_error(slice(begin + 6, end - 6)), corner_error(slice(-10, None))
        yield judged(
            "The lip corner is less accurate during the smile than at the end, when it converges",
            "4.2, figure 9",
            "in the figure",
            [_quantity("smile - end, % of the width", smiling - later, at_least=0)],
            digits=2,
        )
