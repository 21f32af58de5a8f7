"""Where contours end, how large the effective samples are, and what look-ahead is worth."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from jaxpf.papers.judging import estimates
from jaxpf.papers.judging.claims import Quantity, wilson
from jaxpf.papers.judging.comparison_table import Cell, Table
from jaxpf.papers.judging.estimates import mean_cell, only, ratio_of, share_of
from jaxpf.papers.maccormick1999 import published
from jaxpf.papers.maccormick1999.look_ahead import PLAIN, Weighting
from jaxpf.papers.maccormick1999.measure import Found
from jaxpf.papers.maccormick1999.passing import EXCLUSIVE, MUCH_HIDDEN, Passing


def tables(found: Found) -> list[Table]:
    """All of them, in the order in which they are shown."""
    wires, *worms = found.meetings
    return [
        meeting_table(wires),
        look_ahead_table(wires.name, found.ahead),
        *map(meeting_table, worms),
        passing_table(found.leaves),
        passing_table(found.walkers),
    ]


def rate_of(values: np.ndarray, what: str = "", **claimed: Any) -> Quantity:
    """Percentage of ``[cases, runs]`` bool; on one sequence the runs are the units."""
    if len(values) > 1:
        return share_of(values, what, **claimed)
    interval = wilson(values.sum(), values.size)
    return Quantity(what, 100 * float(values.mean()), interval, **claimed)


def rate_of_labels(passing: Passing, method: str, **claimed: Any) -> Quantity:
    """Percentage of the frames with much overlap in which the label says who is in front.

    Frames of a sequence resemble each other, as runs do.
    """
    rates = passing.labels_right(method)
    return estimates.rate_of(rates, passing.frames_judged, **claimed)


def _rate_cell(values: np.ndarray) -> Cell:
    return Cell(None, rate_of(values).measured())


def meeting_table(meeting: Passing) -> Table:
    """Where the contours of look-alikes end."""
    cases, runs = meeting.kept(EXCLUSIVE).shape
    particles = meeting.methods[EXCLUSIVE].num_particles
    return Table(
        f"figure_4_{meeting.name}",
        f"Figure 4 on {meeting.name}: {cases} sequence(s), {runs} runs each, "
        f"{particles} particles (%)",
        ["likelihood", "both on their own", "both on one", "exchanged"],
        [
            (
                name,
                [
                    _rate_cell(ends(name))
                    for ends in (meeting.kept, meeting.coalesced, meeting.swapped)
                ],
            )
            for name in meeting.methods
        ],
        "Partitioned sampling, but where it says Condensation.  The paper shows one run of each "
        "likelihood on one sequence.",
    )


def passing_table(passing: Passing) -> Table:
    """Success, labels, spread and effective sample size of every method."""
    methods = passing.methods
    return Table(
        f"passing_{passing.name}",
        f"{passing.name}: one run on every sequence",
        [
            "method",
            "N",
            "sequences",
            "both kept (%)",
            "both on one (%)",
            "exchanged (%)",
            "label right (%)",
            "widening",
            "narrowing",
            f"effective sample size, {published.FIRST_FRAMES} frames",
        ],
        [
            (
                name,
                [
                    str(methods[name].num_particles),
                    str(len(passing.outcomes[name])),
                    *(
                        _rate_cell(ends(name))
                        for ends in (passing.kept, passing.coalesced, passing.swapped)
                    ),
                    _label_cell(passing, name),
                    *(
                        _ratio_cell(spread(name), 1.0)
                        for spread in (passing.widening, passing.narrowing)
                    ),
                    mean_cell(passing.ess(name), 1),
                ],
            )
            for name in methods
        ],
        f"Labels are judged in the frames in which more than {100 * MUCH_HIDDEN:g} % of the "
        "farther outline is hidden.  Widening is the spread of the hidden contour at the height "
        "of the occlusion over that just before, narrowing that some frames after over that at the "
        "height; both are of runs that keep both.  SIR is ordinary Condensation.",
    )


def _label_cell(passing: Passing, method: str) -> Cell | str:
    if np.isnan(passing.labels_right(method)).all():
        return "-"
    return Cell(None, rate_of_labels(passing, method).measured())


def look_ahead_table(name: str, found: Mapping[str, Weighting]) -> Table:
    """How much the evidence varies between runs, and who is kept."""
    plain = found[PLAIN]
    variances = {way: one.log_evidence.var(axis=1, ddof=1) for way, one in found.items()}
    groups, runs = plain.kept.shape
    return Table(
        f"look_ahead_{name}",
        f"Beyond the paper: look-ahead weighting on {name}, {groups} groups of {runs} runs",
        ["", "N", "time / plain", "sd of log evidence", "its variance / plain's", "both kept (%)"],
        [
            (
                way,
                [
                    str(one.particles),
                    f"{one.seconds / plain.seconds:.2f}",
                    Cell(None, only(np.sqrt(variances[way].mean())), 2),
                    _ratio_cell(variances[way], variances[PLAIN]),
                    _rate_cell(one.kept),
                ],
            )
            for way, one in found.items()
        ],
        "Exclusion, partitioned sampling.  The ratio of variances is the geometric mean over the "
        "groups, whose runs are of one sequence.",
    )


def _ratio_cell(first: np.ndarray, second: np.ndarray | float) -> Cell:
    return Cell(None, ratio_of(first, second).measured(), 2)
