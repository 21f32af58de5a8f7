"""Targets that meet or pass, tracked by several methods: figures 1, 4, 6, 7, 11."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from jaxpf.papers.checkpoints import Measure, each
from jaxpf.papers.judging.claims import counted
from jaxpf.papers.maccormick1999 import scenes, toy
from jaxpf.papers.maccormick1999.measures import measures
from jaxpf.papers.maccormick1999.scenes import Case
from jaxpf.papers.maccormick1999.tracking import REDRAWN, Outcome, track, tracker_of
from jaxpf.papers.study import Study, tidy


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


EXCLUSIVE, NAIVE = "P, exclusion", "P', none"
LIKELIHOODS = {EXCLUSIVE: "wires", NAIVE: "none"}
#: Suffix for ordinary Condensation, as in the paper's section 3.
CONDENSATION = ", Condensation"
#: Suffix for the likelihood as printed, eq. 2 and 5.
PRINTED = " as printed"
PARTITIONED, AS_MANY, FOUR_TIMES, ENOUGH = "PS, 750", "SIR, 750", "SIR, 3000", "SIR, 4000"
#: 750 partitioned particles as in the paper, and the 4000 that it needs without partitions.
LEAVES = {
    PARTITIONED: Method("opaque", "ps", 750),
    # The paper's probability that the depth order changes while targets do not overlap.
    "PS, 750, delta .01": Method("opaque", "ps", 750, 2, flip=0.01),
    PARTITIONED + PRINTED: Method("opaque-literal", "ps", 750),
    AS_MANY: Method("opaque", "sir", 750),
    FOUR_TIMES: Method("opaque", "sir", 3000),
    ENOUGH: Method("opaque", "sir", 4000, 2),
}
#: The paper does not give N of figure 4.
WIRES = {
    **{name: Method(kind, "ps", 300) for name, kind in LIKELIHOODS.items()},
    **{name + CONDENSATION: Method(kind, "sir", 300) for name, kind in LIKELIHOODS.items()},
    EXCLUSIVE + PRINTED + CONDENSATION: Method("wires-literal", "sir", 300),
}
FIGURE_11 = {name: LEAVES[name] for name in (PARTITIONED, AS_MANY)}
OCCLUSION, INDEPENDENT = "occlusion", "two trackers"
#: N of figure 6, and ours for each tracker of figure 1.
WALKERS = {
    OCCLUSION: Method("opaque", "sir", 2000),
    OCCLUSION + PRINTED: Method("opaque-literal", "sir", 2000, 2),
    INDEPENDENT: Method("none", "independent", 2000, 2),
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


def measure_all(seeds: range, quick: bool, report: Callable[[str], None]) -> Study:
    """Run all measurements."""

    def passed(name: str, make: Callable[[int], Case], methods: Mapping[str, Method]) -> Passing:
        report(f"{name}: {counted(len(seeds), 'sequences')}, one run of each method")
        cases: Iterable[Case] = map(make, seeds)
        return measure(cases, seeds, methods, report)

    report("Figure 3 and the toy of figures 9 and 10")
    steps = toy.steps(seeds[0])
    of_leaves, of_walkers = LEAVES, WALKERS
    if quick:
        of_leaves = {name: of_leaves[name] for name in _QUICK_LEAVES}
        of_walkers = {name: of_walkers[name] for name in _QUICK_WALKERS}
    passings = {
        "wires": passed("Figure 4, wires", scenes.wires, WIRES),
        "leaves": passed("Leaves", scenes.leaves, of_leaves),
        "walkers": passed("Walkers", scenes.walkers, of_walkers),
        # Before they overlap, with all measurement lines independent as in the paper.
        "figure_11": passed("Figure 11", scenes.leaves_of_figure_11, FIGURE_11),
    }
    return study(steps, passings)


def study(steps: Mapping[str, Sequence[toy.Step]], passings: Mapping[str, Passing]) -> Study:
    """Rows of all measures, from the toy's steps of one frame by method and from the passings."""
    # Figures 9 and 10: the last step's effective sample size, of each run.
    values: dict[tuple[str, str, str], Any]
    values = {("toy: ess", name, ""): shown[-1].ess for name, shown in steps.items()}
    for kind, passing in passings.items():
        for name, outcomes in passing.outcomes.items():
            method = passing.methods[name]
            for case, outcome in zip(passing.cases, outcomes, strict=False):
                of_case = measures(case, outcome) | {"N": method.num_particles}
                if method.ordering == "independent":
                    # Resampled apart, so that joint particles have equal weights.
                    of_case["ess"] = np.nan
                for measure, value in of_case.items():
                    values.setdefault((f"{kind}: {measure}", name, ""), []).append(value)
    return Study(tidy(values), {"toy": steps, **passings})


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
