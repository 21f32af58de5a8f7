"""What the paper concludes, judged by our runs, and how many runs would settle the rest."""

import math
from collections.abc import Iterator

import numpy as np

from jaxpf.experiments.claims import CANNOT_RESOLVE, Claim, Quantity, judged, student_interval
from jaxpf.experiments.rowe2005 import published, tables
from jaxpf.experiments.rowe2005.synthetic import RUNS_PER_SCENE, Outcome

#: "Negligible": at most this percentage of the samples is lost.
NEGLIGIBLE = 5.0
#: "Collapse": boxes end with at most this share of their true side.
COLLAPSED = 0.5


def claims(outcome: Outcome) -> list[Claim]:
    """All claims with their verdicts."""
    return [*_shares(outcome), *_errors(outcome), *_likelihood(outcome), *_sizes(outcome)]


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


def _quantity(what: str, by_scene: np.ndarray, **claimed: float) -> Quantity:
    finite = by_scene[np.isfinite(by_scene)]
    value = float(finite.mean()) if len(finite) else float("nan")
    interval = student_interval(by_scene)

    def of_scenes(level: float) -> tuple[float, float]:
        return interval(level)

    of_scenes.scenes = len(finite)  # type: ignore[attr-defined]
    return Quantity(what, value, of_scenes, **claimed)


def _shares(outcome: Outcome) -> Iterator[Claim]:
    low, high = published.SHARE_BAND
    yield _judged(
        "Without eq. 4 the tracker loses a target for lack of samples (in most runs)",
        "4, figure 2 (a)",
        "one run shown",
        [
            _quantity(
                "runs with a starved target, %",
                100 * tables.starved(outcome, "without eq. 4").mean(axis=1),
                at_least=50,
            )
        ],
    )
    yield _judged(
        "With eq. 4 each target keeps half of the samples, 49.5 to 50.5 %",
        "4, figure 2 (b)",
        f"{low:g} to {high:g} in each run",
        [
            _quantity(
                "share of target 1, %",
                tables.run_share(outcome, "both").mean(axis=1),
                at_least=low,
                at_most=high,
            )
        ],
        digits=2,
    )
    yield _judged(
        "and no target is ever starved",
        "4, figure 2 (b)",
        "none",
        [
            _quantity(
                "without eq. 4 - with it, points",
                100
                * (
                    tables.starved(outcome, "without eq. 4").mean(axis=1)
                    - tables.starved(outcome, "both").mean(axis=1)
                ),
                at_least=0,
            )
        ],
    )


def _errors(outcome: Outcome) -> Iterator[Claim]:
    off, on = (published.tracked_mean(variant) for variant in ("neither", "both"))
    yield _judged(
        "Regularising and speed feedback reduce the error of the targets that are tracked",
        "4, table 1",
        f"{off:.3f} to {on:.3f}",
        [
            _quantity(
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
            _quantity(
                "neither - both, points",
                100
                * (
                    tables.lost(outcome, "neither").mean(axis=1)
                    - tables.lost(outcome, "both").mean(axis=1)
                ),
                at_least=0,
            )
        ],
        digits=1,
    )
    yield _judged(
        "With both no target is ever lost (in at most 5 % of cases)",
        "4, table 1",
        "0 of 8",
        [_quantity("lost, %", 100 * tables.lost(outcome, "both").mean(axis=1), at_most=5)],
        digits=1,
    )
    yield _judged(
        "They reduce the number of lost samples",
        "4, figure 3",
        "figure",
        [
            _quantity(
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
        [_quantity("both, %", tables.astray(outcome, "both"), at_most=NEGLIGIBLE)],
        digits=1,
    )


def _likelihood(outcome: Outcome) -> Iterator[Claim]:
    yield _judged(
        "The mean of the pixels' densities tracks better in clutter than their product",
        "3.1 (argued, not tested)",
        "–",
        [
            _quantity(
                "targets lost, product - mean, points",
                100
                * (
                    tables.lost(outcome, "product").mean(axis=1)
                    - tables.lost(outcome, "both").mean(axis=1)
                ),
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
            _quantity(
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
            _quantity(
                "side over true side, without",
                tables.last_ratio(outcome, "without size term"),
                at_most=COLLAPSED,
            )
        ],
        digits=2,
    )
