"""Targets that meet or pass each other, tracked by several methods: figures 1, 4, 6, 7, 11, 12."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from jaxpf.experiments.maccormick1999 import published
from jaxpf.experiments.maccormick1999.scenes import Case
from jaxpf.experiments.maccormick1999.tracking import Outcome, track, tracker_of
from jaxpf.experiments.parts import Measure, each

#: Labels are judged where a larger share of the farther target is hidden.
MUCH_HIDDEN = 0.2


class Method(NamedTuple):
    """A filter to compare: its likelihood's exclusion, its ordering, and N."""

    exclusion: str
    ordering: str
    num_particles: int


EXCLUSIVE, NAIVE = "P, exclusion", "P', none"
LIKELIHOODS = {EXCLUSIVE: "wires", NAIVE: "none"}
LEAVES = {
    "PS, 750": Method("opaque", "ps", published.LEAF_PARTICLES),
    "SIR, 750": Method("opaque", "sir", published.LEAF_PARTICLES),
    "SIR, 3000": Method("opaque", "sir", published.LEAF_PARTICLES_FAILING),
    "SIR, 4000": Method("opaque", "sir", published.LEAF_PARTICLES_ENOUGH),
}
WALKERS = {
    "occlusion": Method("opaque", "ps", published.WALKER_PARTICLES),
    "independent": Method("none", "ps", published.WALKER_PARTICLES),
}


def likelihoods(num_particles: int) -> dict[str, Method]:
    """With exclusion and without, by partitioned sampling."""
    return {name: Method(kind, "ps", num_particles) for name, kind in LIKELIHOODS.items()}


class Passing(NamedTuple):
    """Targets that met or passed each other.

    Attributes:
        cases: one or several sequences.
        outcomes: method -> an outcome for each case.
        methods: those of the outcomes.
    """

    cases: Sequence[Case]
    outcomes: Mapping[str, Sequence[Outcome]]
    methods: Mapping[str, Method]

    @property
    def name(self) -> str:
        """Of the sequences."""
        return self.cases[0].name

    def kept(self, method: str) -> np.ndarray:
        """``[cases, runs]`` bool: both contours end on their own targets."""
        return np.array([outcome.kept for outcome in self.outcomes[method]])

    def coalesced(self, method: str) -> np.ndarray:
        """``[cases, runs]`` bool: both end on one."""
        return np.array([outcome.coalesced for outcome in self.outcomes[method]])

    def swapped(self, method: str) -> np.ndarray:
        """``[cases, runs]`` bool: each ends on the other's target."""
        return np.array([outcome.swapped for outcome in self.outcomes[method]])

    def labels_right(self, method: str) -> np.ndarray:
        """``[cases]``: share of the frames with much overlap in which the label is likely right."""
        found = []
        for case, outcome in zip(self.cases, self.outcomes[method], strict=True):
            of_front = outcome.in_front if case.farther == 1 else 1 - outcome.in_front
            of_front = of_front[:, case.hidden > MUCH_HIDDEN]
            found.append(np.mean(np.where(np.isnan(of_front), np.nan, of_front > 0.5)))
        return np.array(found)

    def ess(self, method: str) -> np.ndarray:
        """``[cases]``, mean over the runs and the first frames."""
        frames = slice(published.FIRST_FRAMES)
        return np.array([outcome.ess[:, frames].mean() for outcome in self.outcomes[method]])

    def widening(self, method: str) -> np.ndarray:
        """``[cases]``: spread of the farther contour where most is hidden over that before.

        Of the runs that keep both: where a target is lost, the spread is not that of waiting for
        it.  NaN where none does.
        """
        found = []
        for case, outcome in zip(self.cases, self.outcomes[method], strict=True):
            if not outcome.kept.any():
                found.append(np.nan)
                continue
            spread, hidden = outcome.spread[outcome.kept][:, :, case.farther], case.hidden
            spread = spread.mean(axis=0)
            clear = np.flatnonzero(hidden > 0)[0]
            most = hidden > 0.5 * hidden.max()
            found.append(spread[most].mean() / spread[1 : max(clear, 2)].mean())
        return np.array(found)


def measure(
    cases: Iterable[Case],
    seeds: Sequence[int],
    methods: Mapping[str, Method],
    runs: int,
    report: Callable[[str], None],
) -> Passing:
    """Track every case ``runs`` times by each method; its runs follow its seed."""
    kept: list[Case] = []
    outcomes: dict[str, list[Outcome]] = {name: [] for name in methods}

    def parts() -> Iterator[tuple[str, Measure]]:
        for case, seed in zip(cases, seeds, strict=True):
            kept.append(case)
            for method in methods.values():
                name = "-".join(map(str, (case.name, *method, seed)))
                yield name, partial(_outcome, case, method, runs, seed)

    found = each(parts())
    for done, _ in enumerate(seeds, start=1):
        for name in methods:
            outcomes[name].append(Outcome(**next(found)))
        report(f"  {kept[done - 1].name}: sequence {done} of {len(seeds)} done")
    return Passing(kept, outcomes, methods)


def _outcome(case: Case, method: Method, runs: int, seed: int) -> dict[str, np.ndarray]:
    """Fields of the ``Outcome`` of a case's runs."""
    tracker = tracker_of(case, method.exclusion, method.num_particles, method.ordering)
    return track(case, tracker, runs, seed)._asdict()
