"""Figure 4: look-alikes that meet, with exclusion and without."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from jaxpf.experiments.claims import (
    Claim,
    Measured,
    Quantity,
    cluster_interval,
    judged,
    newcombe,
    student_interval,
    wilson,
)
from jaxpf.experiments.comparison_table import Cell, Table
from jaxpf.experiments.maccormick1999.cases import Case
from jaxpf.experiments.maccormick1999.tracking import Outcome, track_once, tracker_of
from jaxpf.media import plotting

#: Name of a likelihood -> how its targets exclude one another.
LIKELIHOODS = {"P, exclusion": "wires", "P', none": "none"}
EXCLUSIVE, NAIVE = LIKELIHOODS
#: Runs of which this share end on their own targets count as exclusion that works, in percent.
KEEPS_BOTH = 90.0


class Meeting(NamedTuple):
    """Look-alikes that met, tracked by both likelihoods.

    Attributes:
        cases: one or several sequences.
        outcomes: likelihood -> an outcome for each case.
        num_particles: N.
    """

    cases: Sequence[Case]
    outcomes: Mapping[str, Sequence[Outcome]]
    num_particles: int

    @property
    def name(self) -> str:
        """Of the sequences."""
        return self.cases[0].name

    def kept(self, likelihood: str) -> np.ndarray:
        """``[cases, runs]`` bool."""
        return np.array([outcome.kept for outcome in self.outcomes[likelihood]])

    def coalesced(self, likelihood: str) -> np.ndarray:
        """``[cases, runs]`` bool."""
        return np.array([outcome.coalesced for outcome in self.outcomes[likelihood]])


def measure(
    cases: Sequence[Case],
    runs: int,
    num_particles: int,
    seed: int,
    report: Callable[[str], None],
) -> Meeting:
    """Track every case ``runs`` times by each likelihood, with partitioned sampling."""
    outcomes: dict[str, list[Outcome]] = {name: [] for name in LIKELIHOODS}
    for number, case in enumerate(cases):
        for name, exclusion in LIKELIHOODS.items():
            tracker = tracker_of(case, exclusion, num_particles)
            kept = f"{case.name}-{exclusion}-{seed + number}"
            outcomes[name].append(track_once(kept, case, tracker, runs, seed + number))
        report(f"  {case.name}: sequence {number + 1} of {len(cases)} done")
    return Meeting(cases, outcomes, num_particles)


def rate(values: np.ndarray) -> Measured:
    """Percentage of ``[cases, runs]`` with its interval."""
    interval = (
        wilson(values.sum(), values.size)
        if len(values) == 1
        else cluster_interval(values.mean(axis=1), values.shape[1])
    )
    return Measured(100 * float(values.mean()), *interval(0.95))


def table(meeting: Meeting) -> Table:
    """Where the contours end."""
    cases, runs = meeting.kept(EXCLUSIVE).shape
    return Table(
        f"figure_4_{meeting.name}",
        f"Figure 4 on {meeting.name}: {cases} sequence(s), {runs} runs each, "
        f"{meeting.num_particles} particles (%)",
        ["likelihood", "both on their own", "both on one"],
        [
            (
                name,
                [
                    Cell(None, rate(meeting.kept(name))),
                    Cell(None, rate(meeting.coalesced(name))),
                ],
            )
            for name in LIKELIHOODS
        ],
        "The paper shows one run of each on one sequence.",
    )


def claims(meeting: Meeting) -> list[Claim]:
    """That exclusion keeps the targets apart, and its absence does not."""
    kept = {name: meeting.kept(name) for name in LIKELIHOODS}
    return [
        judged(
            f"{meeting.name}: with exclusion both targets are kept (in at least {KEEPS_BOTH:g} % "
            "of the runs)",
            "3, figure 4",
            "one run shown",
            [_kept(kept[EXCLUSIVE])],
        ),
        judged(
            f"{meeting.name}: without it fewer runs keep both",
            "3, figure 4",
            "one run shown, both on one wire",
            [_difference(kept[EXCLUSIVE], kept[NAIVE])],
        ),
    ]


def _kept(values: np.ndarray) -> Quantity:
    if len(values) == 1:
        interval = wilson(values.sum(), values.size)
    else:
        interval = cluster_interval(values.mean(axis=1), values.shape[1])
    return Quantity("", 100 * float(values.mean()), interval, at_least=KEEPS_BOTH)


def _difference(first: np.ndarray, second: np.ndarray) -> Quantity:
    """Points by which the first rate is above the second; by sequence, if there are several."""
    value = 100 * float(first.mean() - second.mean())
    if len(first) == 1:
        interval = newcombe((first.sum(), second.sum()), (first.size, second.size))
    else:
        interval = student_interval(100 * (first.mean(axis=1) - second.mean(axis=1)))
    return Quantity("", value, interval, at_least=0.0)


def figure(meeting: Meeting, num_runs: int = 5) -> Any:
    """Three frames of the first case with the contours of several runs, by each likelihood."""
    case = meeting.cases[0]
    times = np.linspace(0, len(case.frames) - 1, 3).round().astype(int)
    drawing, axes = plotting.new_figure(2, 3, figsize=(12, 6.4))
    for row, name in zip(axes, LIKELIHOODS, strict=True):
        outlines = meeting.outcomes[name][0].outlines[:num_runs]
        for axis, time in zip(row, times, strict=True):
            draw_contours(axis, case.frames[time], outlines[:, time], case.space.closed)
            axis.set_title(f"{name}: frame {time}", fontsize=9)
    drawing.suptitle(f"Figure 4 repeated on {meeting.name}: {num_runs} runs, A and B by colour")
    return drawing


def draw_contours(axis: Any, frame: np.ndarray, outlines: np.ndarray, closed: bool) -> None:
    """A frame with contours ``[R, 2, M, 2]`` of several runs."""
    axis.imshow(frame, extent=(0, frame.shape[1], frame.shape[0], 0))
    for pair in outlines:
        for outline, colour in zip(pair, plotting.colours(2), strict=True):
            line = np.concatenate([outline, outline[:1]]) if closed else outline
            axis.plot(*line.T, color=colour, lw=1, alpha=0.8)
    axis.set(xlim=(0, frame.shape[1]), ylim=(frame.shape[0], 0), xticks=[], yticks=[])
