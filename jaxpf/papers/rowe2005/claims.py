"""What the paper concludes, judged by our runs."""

from collections.abc import Iterator

import numpy as np

from jaxpf.papers.judging.claims import Claim, judged
from jaxpf.papers.judging.estimates import gap_of, mean_of, ratio_of, share_of
from jaxpf.papers.rowe2005 import published, tables
from jaxpf.papers.rowe2005.measure import Found
from jaxpf.papers.rowe2005.scenes import Outcome

#: "Half of the samples": so many runs, in percent, have to lie in the published band; of
#: multinomial resampling 92 are expected to, whatever the tracker does.
IN_BAND = 85.0
#: "Never": in at most this percentage of the cases.
NEVER = 5.0
#: "Negligible": at most this percentage of the samples is lost.
NEGLIGIBLE = 5.0
#: Rates that differ by less than this many points count as equal.
MARGIN = 3.0
#: "Collapse": boxes end with at most this share of their true side.
COLLAPSED = 0.5


def claims(found: Found) -> list[Claim]:
    """All claims with their verdicts."""
    return scene_claims(found.outcome, found.crossing)


def scene_claims(outcome: Outcome, crossing: Outcome) -> list[Claim]:
    """The same; ``crossing`` are the runs on targets that cross."""
    return [
        *_shares(outcome),
        *_errors(outcome),
        *_variance(outcome),
        *_power(outcome),
        *_likelihood(outcome, crossing),
        *_sizes(outcome),
    ]


def _shares(outcome: Outcome) -> Iterator[Claim]:
    low, high = published.SHARE_BAND
    plain, equal = (tables.starved(outcome, variant) for variant in ("without eq. 4", "both"))
    yield judged(
        "Without eq. 4 the tracker loses a target for lack of samples (in most runs)",
        "4, figure 2 (a)",
        "one run shown",
        share_of(plain, "runs with a starved target, %", at_least=50),
    )
    shares = tables.run_share(outcome, "both")
    yield judged(
        f"With eq. 4 each target keeps half of the samples, {low:g} to {high:g} % (in at least "
        f"{IN_BAND:g} % of the runs; by multinomial resampling it would be 92 %)",
        "4, figure 2 (b)",
        f"{low:g} to {high:g} in each run",
        share_of((low <= shares) & (shares <= high), "runs inside, %", at_least=IN_BAND),
    )
    yield judged(
        f"and no target is ever starved (in at most {NEVER:g} % of runs)",
        "5",
        "none",
        share_of(equal, "starved with eq. 4, %", at_most=NEVER),
        gap_of(plain, equal, "without eq. 4 - with it, points", at_least=0, margin=MARGIN),
    )


def _errors(outcome: Outcome) -> Iterator[Claim]:
    off, on = (published.tracked_mean(variant) for variant in ("neither", "both"))

    def less(measure) -> np.ndarray:
        """How much less the whole filter has than the one with neither, scene by scene."""
        return measure(outcome, "neither") - measure(outcome, "both")

    lost = {variant: tables.lost(outcome, variant) for variant in ("neither", "both")}
    yield judged(
        "Regularising and speed feedback reduce the error of the targets that are tracked",
        "4, table 1",
        f"{off:.3f} to {on:.3f}",
        mean_of(less(tables.tracked_error), "neither - both", at_least=0),
        digits=4,
    )
    yield judged(
        "and targets are lost less often",
        "4, table 1",
        "2 of 8 to 0 of 8",
        gap_of(lost["neither"], lost["both"], "neither - both, points", at_least=0, margin=MARGIN),
        digits=1,
    )
    yield judged(
        f"With both no target is ever lost (in at most {NEVER:g} % of cases)",
        "4, table 1",
        "0 of 8",
        share_of(lost["both"], "lost, %", at_most=NEVER),
        digits=1,
    )
    yield judged(
        "They reduce the number of lost samples",
        "4, figure 3",
        "figure",
        mean_of(less(tables.astray), "neither - both, points", at_least=0, margin=MARGIN),
        digits=1,
    )
    yield judged(
        f"to a negligible number (at most {NEGLIGIBLE:g} %)",
        "4, beside figure 3",
        '"negligible"',
        mean_of(tables.astray(outcome, "both"), "both, %", at_most=NEGLIGIBLE),
        digits=1,
    )


def _variance(outcome: Outcome) -> Iterator[Claim]:
    """Of Condensation: without eq. 4, feedback and regularising."""
    of = {name: outcome.of(name) for name in ("Condensation", "both")}
    between, within = outcome.between, outcome.within
    yield judged(
        "Condensation's estimates vary more from run to run than a run of its own tells (ratio of "
        "standard deviations above 1)",
        "2",
        '"high" and "low"',
        ratio_of(
            between[of["Condensation"]],
            within[of["Condensation"]],
            "between runs / within one",
            at_least=1,
        ),
        digits=2,
    )
    yield judged(
        "The proposal deals with it: its estimates vary less from run to run than Condensation's "
        "(ratio above 1)",
        "abstract and 2",
        "–",
        ratio_of(between[of["Condensation"]], between[of["both"]], "without / with", at_least=1),
        digits=2,
    )


def _power(outcome: Outcome) -> Iterator[Claim]:
    lost = {name: tables.lost(outcome, name) for name in ("without power", "both")}
    yield judged(
        "The exponent that grows with the target's size lets samples that fit prevail: without it "
        "more targets are lost",
        "3.4, eq. 8",
        "no figure",
        gap_of(
            lost["without power"], lost["both"], "without - with, points", at_least=0, margin=MARGIN
        ),
        digits=1,
    )


def _likelihood(outcome: Outcome, crossing: Outcome) -> Iterator[Claim]:
    for where, found in (
        ("before strips that mimic them", outcome),
        ("that hide each other", crossing),
    ):
        product, mean = (tables.lost(found, variant) for variant in ("product", "both"))
        yield judged(
            f"The mean of the pixels' densities loses fewer targets {where} than their product",
            "eq. 3, a mean; the paper does not compare",
            "–",
            gap_of(product, mean, "product - mean, points", at_least=0, margin=MARGIN),
            digits=1,
        )


def _sizes(outcome: Outcome) -> Iterator[Claim]:
    kept, free = (tables.last_ratio(outcome, each) for each in ("both", "without size term"))
    yield judged(
        "Without the size term boxes shrink more than with it",
        "3.4",
        '"empirically proved"',
        mean_of(kept - free, "side, with - without", at_least=0),
        digits=2,
    )
    yield judged(
        f"and eventually collapse (to at most {COLLAPSED:g} of their side)",
        "3.4",
        '"eventually, collapse"',
        mean_of(free, "side over true side, without", at_most=COLLAPSED),
        digits=2,
    )
