"""The figures that judge the paper's claims, by the claims' keys.

Keys without a prefix refer to the paper's own swap and dynamics.  "combinatorial" is the unbiased
swap; under "relative" dynamics parts follow their parents.  At equal time, SPS has the number of
particles that takes as long as PS.
"""

import itertools
from collections.abc import Sequence
from functools import partial

import numpy as np

from jaxpf.evaluation.equal_time import between, times_of
from jaxpf.measures import particle_sets
from jaxpf.ordering import named
from jaxpf.papers.gonzales2011.measure import Measurement
from jaxpf.papers.gonzales2011.published import (
    FIGURE_8_PARTICLES,
    FIGURE_8_PARTS,
    FIGURE_9_PARTICLES,
    FIGURE_10_PARTICLES,
    FIGURE_11_PARTICLES,
    FIGURE_11_PARTS,
    PARTS,
)
from jaxpf.papers.gonzales2011.scenes import Outcomes
from jaxpf.papers.gonzales2011.tables import by_scene, gain
from jaxpf.papers.gonzales2011.times import AT_MOST, METHODS, Times
from jaxpf.papers.judging.claims import Quantity, computed
from jaxpf.papers.judging.estimates import ratio_of, share_of

Quantities = dict[str, list[Quantity]]
#: Dynamics and swaps with verdicts; the first are the paper's.
_JUDGED = (("absolute", "sorted"), ("absolute", "combinatorial"), ("relative", "combinatorial"))


def quantities(measured: Measurement) -> Quantities:
    """Key of a claim -> its figures; claims without a measured cell are omitted."""
    figures: Quantities = {"resamplings": resamplings(), "unaltered": [computed(sorted_evidence())]}
    times = {**measured.times, **measured.others}
    for dynamics, swap in _JUDGED:
        figures |= of_curves(measured.outcomes, dynamics, swap)
    for swap in ("sorted", "combinatorial"):
        figures[f"equal_time_{swap}"] = [
            part
            for num_parts in FIGURE_8_PARTS
            for part in at_equal_time(
                measured.outcomes, times, "absolute", f"SPS {swap}", num_parts
            )
        ]
    return figures | of_times(measured.times)


def of_curves(outcomes: Outcomes, dynamics: str, swap: str) -> Quantities:
    """Figures 8 to 11: percentage by which SPS is below PS."""
    prefix = "" if (dynamics, swap) == _JUDGED[0] else f"{swap}_{dynamics}_"

    def gains(motion: str, parts: Sequence[int], number: int, measure: str) -> list[Quantity]:
        figures = []
        for num_parts in parts:
            if outcome := outcomes.get((motion, num_parts, number)):
                values = getattr(outcome, measure)
                ours, base = (by_scene(values[dynamics, m]) for m in (f"SPS {swap}", "PS"))
                figures.append(gain(ours, base, f"{num_parts} parts"))
        return figures

    erratic = partial(gains, "erratic", [FIGURE_11_PARTS], FIGURE_11_PARTICLES)
    figures = {
        f"{prefix}error_{number}": gains("smooth", FIGURE_8_PARTS, number, "error")
        for number in FIGURE_8_PARTICLES
    }
    return figures | {
        f"{prefix}variance": gains("smooth", FIGURE_8_PARTS, FIGURE_9_PARTICLES, "variance"),
        f"{prefix}strong_start": gains("strong_start", PARTS, FIGURE_10_PARTICLES, "error"),
        f"{prefix}erratic_error": erratic("error"),
        f"{prefix}erratic_variance": erratic("variance"),
    }


def sorted_evidence() -> float:
    """Mean evidence estimate of the sorted swap over the exact evidence, by counting.

    Two particles share a parent; each of their two arms fits (likelihood 1) or not (0), with equal
    chances, so that the evidence is 1/4.  The mean is over the sixteen draws.
    """
    draws = np.array(list(itertools.product((0, 1), repeat=4))).reshape(-1, 2, 2)
    left, right = np.sort(draws, axis=2).swapaxes(0, 1)
    return float(np.mean(left * right) / 0.25)


def resamplings() -> list[Quantity]:
    """Ratio of PS's to SPS's number of resamplings per frame."""
    figures = []
    for num_parts in FIGURE_8_PARTS:
        tree = [-1 if part == 0 else max(part - 2, 0) for part in range(num_parts)]
        ps, sps = (
            int(particle_sets.resamplings_per_frame(named(method, tree).resample_after))
            for method in ("ps", "sps")
        )
        figures.append(computed(ps / sps, f"{num_parts} parts, {ps} / {sps}"))
    return figures


def of_times(times: Times) -> Quantities:
    """Table 1: cells in which SPS is at most 4 % slower than PS; each has its own kernel."""
    figures = {}
    for method in METHODS[1:]:
        slower = [np.median(cell[method] / cell["PS"]) for cell in times.values()]
        key = f"time_{method.removeprefix('SPS ')}"
        figures[key] = [share_of((np.array(slower) <= AT_MOST)[:, None])]
    return figures


def at_equal_time(
    outcomes: Outcomes, times: Times, dynamics: str, method: str, num_parts: int
) -> list[Quantity]:
    """Figure 8 for every N of PS whose time lies between those of two N of SPS.

    The number of particles with which SPS takes as long as PS is interpolated on log scales, as in
    ``jaxpf.evaluation.equal_time``, and so is the error there, scene by scene.  Intervals cover the
    values at both ends of the interval of the time ratio.
    """
    tracked = sorted(
        number for motion, parts, number in outcomes if (motion, parts) == ("smooth", num_parts)
    )
    timed = [number for number in tracked if (num_parts, number) in times]

    def seconds(name: str) -> np.ndarray:
        return times_of([1 / np.median(times[num_parts, number][name]) for number in timed])

    def errors(name: str, number: int) -> np.ndarray:
        return by_scene(outcomes["smooth", num_parts, number].error[dynamics, name])

    def read_off(number: int, spent: float) -> Quantity | None:
        if (among := between(seconds(method), spent)) is None:
            return None
        place, share = among
        affords = timed[place] ** (1 - share) * timed[place + 1] ** share
        if (among := between(tracked, affords)) is None:
            return None
        place, share = among
        fewer, more = (errors(method, each) for each in tracked[place : place + 2])
        what = f"{num_parts} parts, N = {number}, of SPS {affords:.0f}"
        return gain((1 - share) * fewer + share * more, errors("PS", number), what)

    figures = []
    for number, spent in zip(timed, seconds("PS"), strict=False):
        both = times[num_parts, number]
        ratio = ratio_of(both["PS"], both[method])
        ends = [float(spent) * end / ratio.value for end in ratio.interval(0.95)]
        parts = [part for each in (spent, *ends) if (part := read_off(number, float(each)))]
        if len(parts) == 3:
            figures.append(parts[0]._replace(interval=partial(_widest, parts)))
    return figures


def _widest(parts: Sequence[Quantity], level: float) -> tuple[float, float]:
    """The lowest and the highest end of the parts' intervals."""
    lows, highs = zip(*(part.interval(level) for part in parts), strict=True)
    return min(lows), max(highs)
