"""Figures 1, 6, 7, 11 and 12: opaque targets, one of which hides the other."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from jaxpf.experiments.claims import (
    Claim,
    Measured,
    Quantity,
    cluster_interval,
    judged,
    student_interval,
)
from jaxpf.experiments.comparison_table import Cell, Table
from jaxpf.experiments.maccormick1999.cases import Case
from jaxpf.experiments.maccormick1999.coalescence import draw_contours, rate
from jaxpf.experiments.maccormick1999.tracking import Outcome, track_once, tracker_of
from jaxpf.media import plotting


class Method(NamedTuple):
    """A filter to compare: its likelihood's exclusion, its ordering, and N."""

    exclusion: str
    ordering: str
    num_particles: int


LEAVES = {
    "PS, 750": Method("opaque", "ps", 750),
    "SIR, 750": Method("opaque", "sir", 750),
    "SIR, 3000": Method("opaque", "sir", 3000),
    "SIR, 4000": Method("opaque", "sir", 4000),
}
WALKERS = {
    "occlusion": Method("opaque", "ps", 2000),
    "independent": Method("none", "ps", 2000),
}
#: Frames over which figure 11 averages.
_FIRST_FRAMES = 10


class Passing(NamedTuple):
    """Targets that passed each other.

    Attributes:
        cases: one or several sequences.
        outcomes: method -> an outcome for each case.
    """

    cases: Sequence[Case]
    outcomes: dict[str, list[Outcome]]

    def kept(self, method: str) -> np.ndarray:
        """``[cases, runs]`` bool."""
        return np.array([outcome.kept for outcome in self.outcomes[method]])

    def ess(self, method: str) -> np.ndarray:
        """``[cases]``, mean over the runs and the first frames."""
        return np.array(
            [outcome.ess[:, :_FIRST_FRAMES].mean() for outcome in self.outcomes[method]]
        )

    def widening(self, method: str) -> np.ndarray:
        """``[cases]``: spread of the farther contour where most is hidden over that before."""
        found = []
        for case, outcome in zip(self.cases, self.outcomes[method], strict=True):
            spread, hidden = outcome.spread[:, :, case.farther].mean(axis=0), case.hidden
            clear = np.flatnonzero(hidden > 0)[0]
            most = hidden > 0.5 * hidden.max()
            found.append(spread[most].mean() / spread[1 : max(clear, 2)].mean())
        return np.array(found)


def measure(
    make: Callable[[int], Case],
    seeds: Sequence[int],
    methods: dict[str, Method],
    runs: int,
    report: Callable[[str], None],
) -> Passing:
    """Track every sequence ``runs`` times by each method."""
    cases = []
    outcomes: dict[str, list[Outcome]] = {name: [] for name in methods}
    for number, seed in enumerate(seeds):
        case = make(seed)
        cases.append(case)
        for name, method in methods.items():
            tracker = tracker_of(case, method.exclusion, method.num_particles, method.ordering)
            kept = f"{case.name}-{name}-{seed}"
            outcomes[name].append(track_once(kept, case, tracker, runs, seed))
        report(f"  {case.name}: sequence {number + 1} of {len(seeds)} done")
    return Passing(cases, outcomes)


def table(passing: Passing) -> Table:
    """Success and effective sample size of every method."""
    name = passing.cases[0].name
    kept = next(iter(passing.outcomes))
    cases, runs = passing.kept(kept).shape
    rows: list[tuple[str, list[Cell | str]]] = []
    for method in passing.outcomes:
        ess = passing.ess(method)
        size = Measured(float(ess.mean()), *student_interval(ess)(0.95))
        rows.append((method, [Cell(None, rate(passing.kept(method))), Cell(None, size, 1)]))
    return Table(
        f"passing_{name}",
        f"{name}: {cases} sequence(s), {runs} runs each",
        ["method", "both kept (%)", f"effective sample size, {_FIRST_FRAMES} frames"],
        rows,
    )


def leaf_claims(passing: Passing) -> list[Claim]:
    """Figures 7, 11 and 12."""
    gain = passing.ess("PS, 750") / passing.ess("SIR, 750")
    success = _difference(passing, "PS, 750", "SIR, 3000")
    kept = passing.kept("PS, 750")
    interval = cluster_interval(kept.mean(axis=1), kept.shape[1])
    return [
        judged(
            "Leaves: 750 particles, partitioned, track both through the occlusion (in most runs)",
            "4, figure 7",
            "one run shown",
            [Quantity("", 100 * float(kept.mean()), interval, at_least=50.0)],
        ),
        judged(
            "The effective sample size of partitioned sampling is far above the unpartitioned "
            "filter's (ratio above 2)",
            "5, figure 11",
            "figure only",
            [Quantity("PS / SIR", float(gain.mean()), student_interval(gain), at_least=2.0)],
            digits=1,
        ),
        judged(
            "750 particles, partitioned, succeed more often than 3000 unpartitioned",
            "5, figure 12",
            "one run shown",
            [success],
        ),
    ]


def walker_claims(passing: Passing) -> list[Claim]:
    """Figures 1 and 6."""
    widening = passing.widening("occlusion")
    return [
        judged(
            "Walkers: with exclusion and occlusion more runs keep both than with independent "
            "trackers",
            "1 and 4, figures 1 and 6",
            "one run shown of each",
            [_difference(passing, "occlusion", "independent")],
        ),
        judged(
            "The hidden contour diffuses: its spread grows while it is hidden (ratio above 1)",
            "4, figure 6",
            "figure only",
            [Quantity("", float(widening.mean()), student_interval(widening), at_least=1.0)],
            digits=2,
        ),
    ]


def _difference(passing: Passing, first: str, second: str) -> Quantity:
    gaps = 100 * (passing.kept(first).mean(axis=1) - passing.kept(second).mean(axis=1))
    return Quantity("", float(gaps.mean()), student_interval(gaps), at_least=0.0)


def figure(passing: Passing, methods: Sequence[str], num_runs: int = 5) -> Any:
    """The first sequence before, in and after the occlusion, with contours of several runs."""
    case = passing.cases[0]
    times = 0, int(case.hidden.argmax()), len(case.frames) - 1
    drawing, axes = plotting.new_figure(len(methods), 3, figsize=(12, 3.2 * len(methods)))
    for row, name in zip(axes, methods, strict=True):
        outlines = passing.outcomes[name][0].outlines[:num_runs]
        for axis, time in zip(row, times, strict=True):
            draw_contours(axis, case.frames[time], outlines[:, time], case.space.closed)
            axis.set_title(f"{name}: frame {time}", fontsize=9)
    drawing.suptitle(f"{case.name}: {len(outlines)} run(s), A and B by colour")
    return drawing
