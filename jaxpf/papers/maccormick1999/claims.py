"""What the paper concludes, judged by our runs."""

from collections.abc import Mapping, Sequence

import numpy as np

from jaxpf.papers.judging.claims import Claim, Quantity, exact, judged, newcombe
from jaxpf.papers.judging.estimates import gap_of, ratio_of
from jaxpf.papers.maccormick1999 import one_line, toy
from jaxpf.papers.maccormick1999.measure import Found
from jaxpf.papers.maccormick1999.passing import (
    AS_MANY,
    CONDENSATION,
    ENOUGH,
    EXCLUSIVE,
    FAILING,
    INDEPENDENT,
    NAIVE,
    OCCLUSION,
    PARTITIONED,
    PUBLISHED_FLIP,
    Passing,
)
from jaxpf.papers.maccormick1999.tables import rate_of, rate_of_labels

#: Runs of which this share end on their own targets count as exclusion that works, in percent.
KEEPS_BOTH = 90.0
#: An occlusion is correctly inferred where the label is right in this share of the frames in which
#: much is hidden, in percent.
INFERRED = 90.0
#: More than half, in percent.
MOST = 50.0
#: Rates that differ by less than this many points count as equal.
MARGIN = 5.0
#: "Much smaller": on the diagonal at most this share of the peaks beside it.
MUCH_SMALLER = 0.5
#: "Far above": at least so many times.
FAR_ABOVE = 2.0


def claims(found: Found) -> list[Claim]:
    """All claims with their verdicts."""
    return [
        line_claim(),
        toy_claim(found.toy),
        *(claim for meeting in found.meetings for claim in meeting_claims(meeting)),
        *leaf_claims(found.leaves),
        *walker_claims(found.walkers),
    ]


def line_claim() -> Claim:
    """What the paper says of figure 3, which has no chance in it."""
    together, apart = one_line.peaks()
    return judged(
        "The likelihood of two targets is much smaller where both lie on one feature than "
        f"where each has its own (at most {MUCH_SMALLER:g} of it)",
        "2, figure 3",
        "figure only",
        exact(float(together.max() / apart.min()), at_least=0.0, at_most=MUCH_SMALLER),
        digits=2,
    )


def toy_claim(steps: Mapping[str, Sequence[toy.Step]]) -> Claim:
    """That the partitioned set is finer."""
    conventional, branched = (steps[method][-1].ess for method in (toy.CONVENTIONAL, toy.BRANCHED))
    return judged(
        "On the toy, the effective sample size of partitioned sampling, with an order for each "
        "label, is above the conventional filter's (ratio above 1)",
        "5, figures 9 and 10",
        "figure only",
        ratio_of(branched, conventional, "PS / SIR", at_least=1.0),
        digits=1,
        unit="repeats",
    )


def meeting_claims(meeting: Passing) -> list[Claim]:
    """Figure 4: that exclusion keeps the targets apart, and its absence does not."""
    found = [
        judged(
            f"{meeting.name}: with exclusion both targets are kept (in at least {KEEPS_BOTH:g} % "
            "of the runs)",
            "3, figure 4",
            "one run shown",
            rate_of(meeting.kept(EXCLUSIVE), at_least=KEEPS_BOTH),
        ),
        judged(
            f"{meeting.name}: without it fewer runs keep both",
            "3, figure 4",
            "one run shown, both on one wire",
            _more_kept(meeting, EXCLUSIVE, NAIVE),
        ),
        judged(
            f"{meeting.name}: without it more runs end with both on one",
            "3, figure 4",
            "one run shown, both on one wire",
            _gap(meeting.coalesced(NAIVE), meeting.coalesced(EXCLUSIVE)),
        ),
    ]
    if NAIVE + CONDENSATION in meeting.methods:
        naive, exclusive = (meeting.coalesced(name + CONDENSATION) for name in (NAIVE, EXCLUSIVE))
        found.append(
            judged(
                f"{meeting.name}: without it more runs of ordinary Condensation, the paper's, end "
                "with both on one",
                "3, figure 4",
                "one run shown, both on one wire",
                _gap(naive, exclusive),
            )
        )
    return found


def leaf_claims(passing: Passing) -> list[Claim]:
    """Figures 7, 11 and 12."""
    number = len(passing.outcomes[AS_MANY])
    gain = ratio_of(
        passing.ess(PARTITIONED)[:number], passing.ess(AS_MANY), "PS / SIR", at_least=FAR_ABOVE
    )
    found = [
        judged(
            "Leaves: 750 particles, partitioned, track both through the occlusion (on at least "
            f"{KEEPS_BOTH:g} % of the sequences)",
            "4, figure 7",
            "one run shown",
            rate_of(passing.kept(PARTITIONED), at_least=KEEPS_BOTH),
        ),
        *(
            labels_claim(passing, method, "4, figure 7")
            for method in (PARTITIONED, PARTITIONED + PUBLISHED_FLIP)
            if method in passing.methods
        ),
        judged(
            "The effective sample size of partitioned sampling is far above the unpartitioned "
            f"filter's (ratio above {FAR_ABOVE:g})",
            "5, figure 11",
            "figure only",
            gain,
            digits=1,
        ),
        judged(
            "750 particles, partitioned, succeed more often than 3000 unpartitioned",
            "5, figure 12",
            "one run shown",
            _more_kept(passing, PARTITIONED, FAILING),
        ),
    ]
    if ENOUGH in passing.methods:
        found.append(
            judged(
                "Leaves: 4000 particles without partitioned sampling track both, too (on most "
                "sequences)",
                "4",
                "told, none shown",
                rate_of(passing.kept(ENOUGH), at_least=MOST),
            )
        )
    return found


def walker_claims(passing: Passing) -> list[Claim]:
    """Figures 1 and 6."""
    found = [
        judged(
            "Walkers: with exclusion and occlusion both are kept (on most sequences)",
            "4, figure 6",
            "one run shown",
            rate_of(passing.kept(OCCLUSION), at_least=MOST),
        ),
        judged(
            "Walkers: with exclusion and occlusion more runs keep both than with independent "
            "trackers",
            "1 and 4, figures 1 and 6",
            "one run shown of each",
            _more_kept(passing, OCCLUSION, INDEPENDENT),
        ),
        judged(
            "Walkers: more runs of independent trackers end with both on one",
            "1 and 4, figures 1 and 6",
            "one run shown of each",
            _gap(passing.coalesced(INDEPENDENT), passing.coalesced(OCCLUSION)),
        ),
        labels_claim(passing, OCCLUSION, "4, figure 6"),
        judged(
            "The hidden contour diffuses: its spread grows while it is hidden (ratio above 1)",
            "4, figure 6",
            "figure only",
            ratio_of(passing.widening(OCCLUSION), 1.0, at_least=1.0),
            digits=2,
        ),
        judged(
            "It narrows again once its target is seen: its spread some frames after the occlusion "
            "is below that at its height (ratio below 1)",
            "4, figure 6",
            "figure only",
            ratio_of(passing.narrowing(OCCLUSION), 1.0, at_most=1.0),
            digits=2,
        ),
    ]
    condensation = OCCLUSION + CONDENSATION
    if condensation in passing.methods:
        found.append(
            judged(
                "Walkers: with exclusion and occlusion ordinary Condensation, the paper's, keeps "
                "both (on most sequences)",
                "4, figure 6",
                "one run shown",
                rate_of(passing.kept(condensation), at_least=MOST),
            )
        )
    return found


def labels_claim(passing: Passing, method: str, source: str) -> Claim:
    """That the occlusion is correctly inferred, by the truth of the scenes."""
    return judged(
        f"{passing.name.capitalize()}, {method}: the label says who is in front (in at least "
        f"{INFERRED:g} % of the frames with much overlap)",
        source,
        "one run shown",
        rate_of_labels(passing, method, at_least=INFERRED),
    )


def _more_kept(passing: Passing, first: str, second: str) -> Quantity:
    return _gap(passing.kept(first), passing.kept(second))


def _gap(one: np.ndarray, other: np.ndarray) -> Quantity:
    """Points by which the first rate is above the second, on the sequences that both have.

    By sequence, if there are several.
    """
    number = min(len(one), len(other))
    one, other = one[:number], other[:number]
    if number > 1:
        return gap_of(one, other, at_least=0.0, margin=MARGIN)
    value = 100 * float(one.mean() - other.mean())
    interval = newcombe((one.sum(), other.sum()), (one.size, other.size))
    return Quantity("", value, interval, at_least=0.0, margin=MARGIN)
