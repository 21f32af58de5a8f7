"""Final positions of contours, and effective sample sizes."""

import numpy as np

from jaxpf.files.tables import Table
from jaxpf.papers.judging import estimates
from jaxpf.papers.judging.claims import Quantity, counted
from jaxpf.papers.judging.comparison_table import Cell
from jaxpf.papers.judging.estimates import mean_cell, ratio_of, share_cell
from jaxpf.papers.maccormick1999 import published
from jaxpf.papers.maccormick1999.measure import Measurement
from jaxpf.papers.maccormick1999.passing import (
    INDEPENDENT,
    MUCH_HIDDEN,
    WIRE_PARTICLES,
    Passing,
)


def tables(measured: Measurement) -> list[Table]:
    """All tables, in display order."""
    return [
        meeting_table(measured.wires),
        passing_table(measured.leaves),
        passing_table(measured.walkers),
        ess_table(measured.figure_11),
    ]


def rate_of_labels(passing: Passing, method: str) -> Quantity:
    """Percentage of frames with strong overlap in which the label has the depth order right."""
    return estimates.rate_of(passing.labels_right(method))


def meeting_table(meeting: Passing) -> Table:
    """Final positions of the contours of look-alikes."""
    return Table(
        f"figure_4_{meeting.name}",
        f"Figure 4: {counted(len(meeting.cases), 'sequences')} of {meeting.name}, one run on each, "
        f"{WIRE_PARTICLES} particles (%)",
        ["likelihood", "both on their own", "both on one", "exchanged"],
        [
            (
                name,
                [
                    share_cell(ends(name))
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
                        share_cell(ends(name))
                        for ends in (passing.kept, passing.coalesced, passing.swapped)
                    ),
                    _label_cell(passing, name),
                    *(
                        _ratio_cell(spread(name), 1.0)
                        for spread in (passing.widening, passing.narrowing)
                    ),
                    # Two trackers are resampled apart; their joint particles have equal weights.
                    "-" if name == INDEPENDENT else mean_cell(passing.ess(name), 1),
                ],
            )
            for name in methods
        ],
        f"Labels are judged in the frames in which more than {100 * MUCH_HIDDEN:g} % of the "
        "farther outline is hidden.  Widening is the spread of the hidden contour at the height "
        "of the occlusion over that just before, narrowing that some frames after over that at the "
        "height; both are of runs that keep both.  SIR, and every method for walkers, "
        "is ordinary Condensation.",
    )


def _label_cell(passing: Passing, method: str) -> Cell | str:
    if np.isnan(passing.labels_right(method)).all():
        return "-"
    return Cell(None, rate_of_labels(passing, method).measured())


def ess_table(passing: Passing) -> Table:
    """Figure 11: effective sample sizes before the leaves overlap."""
    return Table(
        "figure_11",
        f"Figure 11: effective sample size, mean over {published.FIRST_FRAMES} frames",
        ["method", "effective sample size"],
        [(name, [mean_cell(passing.ess(name), 1)]) for name in passing.methods],
        f"{counted(len(passing.cases), 'sequences')} of leaves; every line counts in full.",
    )


def _ratio_cell(first: np.ndarray, second: np.ndarray | float) -> Cell:
    return Cell(None, ratio_of(first, second).measured(), 2)
