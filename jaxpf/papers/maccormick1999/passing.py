"""Targets that meet or pass, tracked by several methods: figures 1, 4, 6, 7, 11."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from jaxpf.filters.partitioned.tracker import Partitioned
from jaxpf.papers.checkpoints import of_scenes
from jaxpf.papers.judging.claims import counted
from jaxpf.papers.maccormick1999 import scenes, toy
from jaxpf.papers.maccormick1999.measures import measures
from jaxpf.papers.maccormick1999.scenes import Case, as_printed
from jaxpf.papers.maccormick1999.tracking import REDRAWN, track, tracker_of
from jaxpf.papers.study import Study, tidy
from jaxpf.targets.presets import MACCORMICK1999

Values = dict[tuple[str, str, str], Any]


class Method(NamedTuple):
    """A filter to compare.

    Attributes:
        exclusion: exclusion of its likelihood.
        ordering: see ``tracker_of``.
        num_particles: N.
        one_in: tracks only the first 1 / one_in of the sequences, since slow filters take long.
        flip: see ``tracker_of``.
        all_printed: whether labels, lines, edges and resampling are the paper's.
    """

    exclusion: str
    ordering: str
    num_particles: int
    one_in: int = 1
    flip: float = REDRAWN
    all_printed: bool = False


def _as_preset(preset: Mapping[str, Any]) -> Method:
    """The method of a preset."""
    exclusion, ordering, particles = map(
        preset.__getitem__, ("exclusion", "method", "num_particles")
    )
    return Method(exclusion, ordering, particles, all_printed=True)


EXCLUSIVE, NAIVE = "P, exclusion", "P', none"
LIKELIHOODS = {EXCLUSIVE: "wires", NAIVE: "none"}
#: Suffix for ordinary Condensation, as in the paper's section 3.
CONDENSATION = ", Condensation"
#: Suffix for the likelihood as printed, eq. 2 and 5.
PRINTED = " as printed"
#: Suffix where labels, lines, edges and resampling are as printed, too.
ALL_PRINTED = ", all as printed"
_WIRES, _OPAQUE = MACCORMICK1999["wires"], MACCORMICK1999["opaque"]
#: The paper's probability that the depth order changes while targets do not overlap.
FLIP: float = _OPAQUE["flip"]
PARTITIONED, AS_MANY, FOUR_TIMES, ENOUGH = "PS, 750", "SIR, 750", "SIR, 3000", "SIR, 4000"
#: 750 partitioned particles as in the paper, and the 4000 that it needs without partitions.
LEAVES = {
    PARTITIONED: Method("opaque", "ps", 750),
    "PS, 750, delta .01": Method("opaque", "ps", 750, 2, FLIP),
    PARTITIONED + PRINTED: Method("opaque-literal", "ps", 750),
    PARTITIONED + ALL_PRINTED: _as_preset(_OPAQUE),
    AS_MANY: Method("opaque", "sir", 750),
    FOUR_TIMES: Method("opaque", "sir", 3000),
    ENOUGH: Method("opaque", "sir", 4000, 2),
}
#: The paper does not give N of figure 4.
WIRES = {
    **{name: Method(kind, "ps", 300) for name, kind in LIKELIHOODS.items()},
    **{name + CONDENSATION: Method(kind, "sir", 300) for name, kind in LIKELIHOODS.items()},
    EXCLUSIVE + ALL_PRINTED: _as_preset(_WIRES),
}
FIGURE_11 = {name: LEAVES[name] for name in (PARTITIONED, AS_MANY)}
OCCLUSION, INDEPENDENT = "occlusion", "two trackers"
#: N of figure 6, and ours for each tracker of figure 1.
WALKERS = {
    OCCLUSION: Method("opaque", "sir", 2000),
    OCCLUSION + ALL_PRINTED: Method("opaque-literal", "sir", 2000, 2, all_printed=True),
    INDEPENDENT: Method("none", "independent", 2000, 2),
}

#: Methods of the quick version.
_QUICK_LEAVES = PARTITIONED, AS_MANY
_QUICK_WALKERS = OCCLUSION, INDEPENDENT


class Passing(NamedTuple):
    """What the figures show of targets that met or passed each other.

    Attributes:
        case: the first sequence.
        outlines: method -> estimates ``[1, T, 2, M, 2]`` on it.
        ess: method -> effective sample sizes ``[S, T]`` on all sequences.
    """

    case: Case
    outlines: Mapping[str, np.ndarray]
    ess: Mapping[str, np.ndarray]


def measure_all(seeds: range, quick: bool, report: Callable[[str], None]) -> Study:
    """Run all measurements; the figures show the toy's steps and a ``Passing`` of every kind."""
    report("Figure 3 and the toy of figures 9 and 10")
    steps = toy.steps(seeds[0])
    shown: dict[str, Any] = {"toy": steps}
    # Figures 9 and 10: the last step's effective sample size, of each run.
    values: Values = {("toy: ess", name, ""): of_name[-1].ess for name, of_name in steps.items()}
    leaves, walkers = (
        {name: methods[name] for name in (names if quick else methods)}
        for methods, names in ((LEAVES, _QUICK_LEAVES), (WALKERS, _QUICK_WALKERS))
    )
    for kind, title, make, methods in (
        ("wires", "Figure 4, wires", scenes.wires, WIRES),
        ("leaves", "Leaves", scenes.leaves, leaves),
        ("walkers", "Walkers", scenes.walkers, walkers),
        # Before they overlap, with all measurement lines independent as in the paper.
        ("figure_11", "Figure 11", scenes.leaves_of_figure_11, FIGURE_11),
    ):
        report(f"{title}: {counted(len(seeds), 'sequences')}, one run of each method")
        measured, shown[kind] = measure(kind, make, methods, seeds, report)
        values |= measured
    return Study(tidy(values), shown)


def measure(
    kind: str,
    make: Callable[[int], Case],
    methods: Mapping[str, Method],
    seeds: Sequence[int],
    report: Callable[[str], None],
) -> tuple[Values, Passing]:
    """Track the sequence of every seed once by each method; the seed determines the runs."""
    least = min(len(seeds), 3)  # for an interval
    tracked = {
        name: seeds[: max(len(seeds) // method.one_in, least)] for name, method in methods.items()
    }
    found = of_scenes(kind, partial(_on_scene, make, methods, tracked, seeds[0]), seeds, report)
    arrays = {tuple(name.split(": ")): each for name, each in found.items()}
    values = {
        (f"{kind}: {what}", name, ""): each
        for (name, what), each in arrays.items()
        if each.ndim == 1
    }
    outlines, ess = (
        {name: arrays[name, what] for name in methods} for what in ("outlines", "ess curve")
    )
    return values, Passing(make(seeds[0]), outlines, ess)


def tracker_as_judged(case: Case, method: Method) -> Partitioned:
    """The tracker of a method on a case."""
    kind, ordering, particles, _, flip, all_printed = method
    if all_printed:
        used = as_printed(case)
        return tracker_of(used, kind, particles, ordering, FLIP, _OPAQUE["resampling"])
    return tracker_of(case, kind, particles, ordering, flip)


def _on_scene(
    make: Callable[[int], Case],
    methods: Mapping[str, Method],
    tracked: Mapping[str, Sequence[int]],
    first: int,
    seed: int,
) -> dict[str, Any]:
    """Measures and arrays of a ``Passing``, named such as "PS, 750: kept", of a seed's sequence."""
    case = make(seed)
    found: dict[str, Any] = {}
    for name, method in methods.items():
        if seed not in tracked[name]:
            continue
        outcome = track(case, tracker_as_judged(case, method), 1, seed)
        arrays = measures(case, outcome) | {"N": method.num_particles, "ess curve": outcome.ess[0]}
        if method.ordering == "independent":
            # Resampled apart, so that joint particles have equal weights.
            arrays["ess"] = np.nan
        if seed == first:
            arrays["outlines"] = outcome.outlines[0]
        found |= {f"{name}: {what}": each for what, each in arrays.items()}
    return found
