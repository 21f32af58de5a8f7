"""What the paper concludes, judged by our runs."""

from collections.abc import Mapping

import numpy as np

from jaxpf.experiments.claims import Claim, Quantity, exact, judged, newcombe
from jaxpf.experiments.estimates import gap_of, mean_of, ratio_of
from jaxpf.experiments.maccormick1999 import one_line
from jaxpf.experiments.maccormick1999.measure import Found
from jaxpf.experiments.maccormick1999.passing import EXCLUSIVE, NAIVE, Passing
from jaxpf.experiments.maccormick1999.tables import rate_of

#: Runs of which this share end on their own targets count as exclusion that works, in percent.
KEEPS_BOTH = 90.0
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


def toy_claim(sets: Mapping[str, tuple[np.ndarray, np.ndarray]]) -> Claim:
    """That the partitioned set is finer."""
    ess = {name: 1 / (weights**2).sum(axis=1) for name, (_, weights) in sets.items()}
    return judged(
        "On the toy, the effective sample size of partitioned sampling is above the "
        "conventional filter's (ratio above 1)",
        "5, figures 9 and 10",
        "figure only",
        ratio_of(ess["PS"], ess["SIR"], "PS / SIR", at_least=1.0),
        digits=1,
    )


def meeting_claims(meeting: Passing) -> list[Claim]:
    """Figure 4: that exclusion keeps the targets apart, and its absence does not."""
    return [
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


def leaf_claims(passing: Passing) -> list[Claim]:
    """Figures 7, 11 and 12."""
    gain = ratio_of(passing.ess("PS, 750"), passing.ess("SIR, 750"), "PS / SIR", at_least=FAR_ABOVE)
    return [
        judged(
            "Leaves: 750 particles, partitioned, track both through the occlusion (in most runs)",
            "4, figure 7",
            "one run shown",
            rate_of(passing.kept("PS, 750"), at_least=50.0),
        ),
        judged(
            "Leaves: the label says who is in front (in most frames with much overlap)",
            "4, figure 7",
            "one run shown",
            mean_of(100 * passing.labels_right("PS, 750"), at_least=50.0),
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
            _more_kept(passing, "PS, 750", "SIR, 3000"),
        ),
    ]


def walker_claims(passing: Passing) -> list[Claim]:
    """Figures 1 and 6."""
    return [
        judged(
            "Walkers: with exclusion and occlusion more runs keep both than with independent "
            "trackers",
            "1 and 4, figures 1 and 6",
            "one run shown of each",
            _more_kept(passing, "occlusion", "independent"),
        ),
        judged(
            "The hidden contour diffuses: its spread grows while it is hidden (ratio above 1)",
            "4, figure 6",
            "figure only",
            ratio_of(passing.widening("occlusion"), 1.0, at_least=1.0),
            digits=2,
        ),
    ]


def _more_kept(passing: Passing, first: str, second: str) -> Quantity:
    return _gap(passing.kept(first), passing.kept(second))


def _gap(one: np.ndarray, other: np.ndarray) -> Quantity:
    """Points by which the first rate is above the second; by sequence, if there are several."""
    if len(one) > 1:
        return gap_of(one, other, at_least=0.0, margin=MARGIN)
    value = 100 * float(one.mean() - other.mean())
    interval = newcombe((one.sum(), other.sum()), (one.size, other.size))
    return Quantity("", value, interval, at_least=0.0, margin=MARGIN)
