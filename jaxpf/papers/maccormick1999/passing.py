"""Targets that meet or pass, tracked by several methods: figures 1, 4, 6, 7, 11."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from jaxpf.papers.checkpoints import Measure, each
from jaxpf.papers.judging.claims import counted
from jaxpf.papers.maccormick1999 import published, scenes, toy
from jaxpf.papers.maccormick1999.scenes import Case
from jaxpf.papers.maccormick1999.tracking import REDRAWN, Outcome, track, tracker_of
from jaxpf.papers.paper import Request

#: Labels are judged where more than this share of the farther target is hidden.
MUCH_HIDDEN = 0.2
#: Number of frames just before an occlusion, and frames after it, for comparing spreads.
_BEFORE, _AFTER = 5, slice(5, 10)


class Method(NamedTuple):
    """A filter to compare.

    Attributes:
        exclusion: exclusion of its likelihood.
        ordering: see ``tracker_of``.
        num_particles: N.
        one_in: tracks only the first 1 / one_in of the sequences, since slow filters take long.
        flip: see ``tracker_of``.
    """

    exclusion: str
    ordering: str
    num_particles: int
    one_in: int = 1
    flip: float = REDRAWN


#: N of figure 4, which the paper does not give.
WIRE_PARTICLES = 300
EXCLUSIVE, NAIVE = "P, exclusion", "P', none"
LIKELIHOODS = {EXCLUSIVE: "wires", NAIVE: "none"}
#: Suffix for ordinary Condensation, as in the paper's section 3.
CONDENSATION = ", Condensation"
#: Suffix for the likelihood as printed, eq. 2 and 5.
PRINTED = " as printed"
#: Suffix for the paper's probability that labels change.
PUBLISHED_FLIP = f", delta {published.DELTA:g}".replace("0.", ".")
PARTITIONED, AS_MANY = f"PS, {published.LEAF_PARTICLES}", f"SIR, {published.LEAF_PARTICLES}"
FOUR_TIMES = f"SIR, {4 * published.LEAF_PARTICLES}"
ENOUGH = f"SIR, {published.LEAF_PARTICLES_ENOUGH}"
LEAVES = {
    PARTITIONED: Method("opaque", "ps", published.LEAF_PARTICLES),
    PARTITIONED + PUBLISHED_FLIP: Method(
        "opaque", "ps", published.LEAF_PARTICLES, 2, published.DELTA
    ),
    PARTITIONED + PRINTED: Method("opaque-literal", "ps", published.LEAF_PARTICLES),
    AS_MANY: Method("opaque", "sir", published.LEAF_PARTICLES),
    FOUR_TIMES: Method("opaque", "sir", 4 * published.LEAF_PARTICLES),
    ENOUGH: Method("opaque", "sir", published.LEAF_PARTICLES_ENOUGH, 2),
}
WIRES = {
    **{name: Method(kind, "ps", WIRE_PARTICLES) for name, kind in LIKELIHOODS.items()},
    **{
        name + CONDENSATION: Method(kind, "sir", WIRE_PARTICLES)
        for name, kind in LIKELIHOODS.items()
    },
    EXCLUSIVE + PRINTED + CONDENSATION: Method("wires-literal", "sir", WIRE_PARTICLES),
}
FIGURE_11 = {
    PARTITIONED: LEAVES[PARTITIONED],
    AS_MANY: LEAVES[AS_MANY],
}
OCCLUSION, INDEPENDENT = "occlusion", "two trackers"
WALKERS = {
    OCCLUSION: Method("opaque", "sir", published.WALKER_PARTICLES),
    OCCLUSION + PRINTED: Method("opaque-literal", "sir", published.WALKER_PARTICLES, 2),
    INDEPENDENT: Method("none", "independent", published.WALKER_PARTICLES, 2),
}


#: Methods of the quick version.
_QUICK_LEAVES = PARTITIONED, AS_MANY
_QUICK_WALKERS = OCCLUSION, INDEPENDENT


class Passing(NamedTuple):
    """Targets that met or passed each other.

    Attributes:
        cases: one or more sequences; only the first keeps its frames.
        outcomes: method -> one outcome per case, or for the first cases only.
        methods: the methods of the outcomes.
    """

    cases: Sequence[Case]
    outcomes: Mapping[str, Sequence[Outcome]]
    methods: Mapping[str, Method]

    def of(self, field: str, method: str) -> np.ndarray:
        """``[cases, runs, ...]``, a field of the outcomes."""
        return np.array([getattr(outcome, field) for outcome in self.outcomes[method]])

    def labels_right(self, method: str) -> np.ndarray:
        """``[cases]``: share of frames with strong overlap whose more likely label is right."""
        shares = []
        for case, outcome in self._of(method):
            of_front = outcome.in_front if case.farther == 1 else 1 - outcome.in_front
            of_front = of_front[:, case.hidden > MUCH_HIDDEN]
            shares.append(np.mean(np.where(np.isnan(of_front), np.nan, of_front > 0.5)))
        return np.array(shares)

    def widening(self, method: str) -> np.ndarray:
        """``[cases]``: the farther contour's spread at the height of the occlusion over before.

        Only runs that keep both targets count: the spread of a lost target means something else.
        NaN if no run keeps both.
        """
        before, hidden, _ = self._spreads(method)
        return hidden / before

    def narrowing(self, method: str) -> np.ndarray:
        """``[cases]``: its spread some frames after the occlusion over that at the height.

        Only runs that keep both targets count; see ``widening``.
        """
        _, hidden, after = self._spreads(method)
        return after / hidden

    def _spreads(self, method: str) -> np.ndarray:
        """``[3, cases]``: just before the occlusion, at its height, and some frames after it."""
        spreads = []
        for case, outcome in self._of(method):
            spread = outcome.spread[outcome.kept][:, :, case.farther]  # [kept, T]
            if not len(spread):
                spreads.append([np.nan] * 3)
                continue
            spread, hidden = spread.mean(axis=0), case.hidden
            covered = np.flatnonzero(hidden > 0)
            first, after = max(covered[0], 1), spread[covered[-1] + 1 :][_AFTER]
            before = spread[max(first - _BEFORE, 0) : first].mean()
            height = spread[hidden > 0.5 * hidden.max()].mean()
            spreads.append([before, height, after.mean() if len(after) else np.nan])
        return np.array(spreads).T

    def _of(self, method: str) -> Iterator[tuple[Case, Outcome]]:
        return zip(self.cases, self.outcomes[method], strict=False)


class Measurement(NamedTuple):
    """All measurements.

    Attributes:
        toy: method -> steps of one frame.
        wires: wires that meet, with and without exclusion.
        leaves: leaves that pass each other.
        walkers: walkers that pass each other.
        figure_11: leaves before they overlap, with all measurement lines independent as in the
            paper.
    """

    toy: Mapping[str, Sequence[toy.Step]]
    wires: Passing
    leaves: Passing
    walkers: Passing
    figure_11: Passing


def measure_all(request: Request) -> Measurement:
    """Run all measurements."""
    seeds, report = request.seeds, request.report

    def passed(name: str, make: Callable[[int], Case], methods: Mapping[str, Method]) -> Passing:
        report(f"{name}: {counted(len(seeds), 'sequences')}, one run of each method")
        cases: Iterable[Case] = map(make, seeds)
        return measure(cases, seeds, methods, report)

    report("Figure 3 and the toy of figures 9 and 10")
    steps = toy.steps(seeds[0])
    of_leaves, of_walkers = LEAVES, WALKERS
    if request.quick:
        of_leaves = {name: of_leaves[name] for name in _QUICK_LEAVES}
        of_walkers = {name: of_walkers[name] for name in _QUICK_WALKERS}
    return Measurement(
        steps,
        passed("Figure 4, wires", scenes.wires, WIRES),
        passed("Leaves", scenes.leaves, of_leaves),
        passed("Walkers", scenes.walkers, of_walkers),
        passed("Figure 11", scenes.leaves_of_figure_11, FIGURE_11),
    )


def measure(
    cases: Iterable[Case],
    seeds: Sequence[int],
    methods: Mapping[str, Method],
    report: Callable[[str], None],
) -> Passing:
    """Track every case once by each method; its seed determines the run."""
    kept: list[Case] = []
    # At least three, for an interval.
    least = min(len(seeds), 3)
    last = {name: max(len(seeds) // method.one_in, least) for name, method in methods.items()}
    tracked = [[name for name in methods if number < last[name]] for number in range(len(seeds))]
    outcomes: dict[str, list[Outcome]] = {name: [] for name in methods}

    def parts() -> Iterator[tuple[str, Measure]]:
        for case, seed, names in zip(cases, seeds, tracked, strict=True):
            # Figures show the first case; the frames of many sequences would fill the memory.
            kept.append(case._replace(frames=case.frames[:0]) if kept else case)
            for method in map(methods.__getitem__, names):
                name = "-".join(map(str, (case.name, *method[:3], method.flip, seed)))
                yield name, partial(_outcome, case, method, seed)

    measured = each(parts())
    for done, names in enumerate(tracked, start=1):
        for name in names:
            outcomes[name].append(Outcome(**next(measured)))
        report(f"  {kept[done - 1].name}: sequence {done} of {len(seeds)} done")
    return Passing(kept, outcomes, methods)


def _outcome(case: Case, method: Method, seed: int) -> dict[str, np.ndarray]:
    """Fields of the ``Outcome`` of a run."""
    kind, ordering, particles, _, flip = method
    tracker = tracker_of(case, kind, particles, ordering, flip)
    return track(case, tracker, 1, seed)._asdict()
