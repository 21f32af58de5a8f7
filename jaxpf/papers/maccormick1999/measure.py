"""All measurements for the paper."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple

from jaxpf.papers.judging.claims import counted
from jaxpf.papers.maccormick1999 import passing, scenes, toy
from jaxpf.papers.maccormick1999.passing import Method, Passing
from jaxpf.papers.maccormick1999.toy import Step
from jaxpf.papers.paper import Request

#: Methods of the quick version.
_QUICK_LEAVES = passing.PARTITIONED, passing.AS_MANY
_QUICK_WALKERS = passing.OCCLUSION, passing.INDEPENDENT


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

    toy: Mapping[str, Sequence[Step]]
    wires: Passing
    leaves: Passing
    walkers: Passing
    figure_11: Passing


def measure(request: Request) -> Measurement:
    """Run all measurements."""
    seeds, seed, report = request.seeds, request.seed, request.report

    def passed(
        name: str, make: Callable[[int], scenes.Case], methods: Mapping[str, Method]
    ) -> Passing:
        report(f"{name}: {counted(len(seeds), 'sequences')}, one run of each method")
        cases: Iterable[scenes.Case] = map(make, seeds)
        return passing.measure(cases, seeds, methods, report)

    report("Figure 3 and the toy of figures 9 and 10")
    steps = toy.steps(seed)
    of_leaves, of_walkers = passing.LEAVES, passing.WALKERS
    if request.quick:
        of_leaves = {name: of_leaves[name] for name in _QUICK_LEAVES}
        of_walkers = {name: of_walkers[name] for name in _QUICK_WALKERS}
    return Measurement(
        steps,
        passed("Figure 4, wires", scenes.wires, passing.WIRES),
        passed("Leaves", scenes.leaves, of_leaves),
        passed("Walkers", scenes.walkers, of_walkers),
        passed("Figure 11", scenes.leaves_of_figure_11, passing.FIGURE_11),
    )
