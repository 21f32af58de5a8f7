"""The figures that judge the paper's claims, by the claims' keys.

Keys without a prefix refer to the paper's own swap and dynamics.  "combinatorial" is the unbiased
swap; under "relative" dynamics parts follow their parents.
"""

import math
from collections.abc import Sequence
from functools import partial

import numpy as np

from jaxpf.measures import particle_sets
from jaxpf.ordering import named
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
from jaxpf.papers.judging.claims import Quantity, computed

Quantities = dict[str, list[Quantity]]
#: Dynamics and swaps with verdicts; the first are the paper's.
_JUDGED = (("absolute", "sorted"), ("absolute", "combinatorial"), ("relative", "combinatorial"))


def quantities(outcomes: Outcomes) -> Quantities:
    """Key of a claim -> its figures; claims without a measured cell are omitted."""
    figures: Quantities = {}
    for dynamics, swap in _JUDGED:
        figures |= of_curves(outcomes, dynamics, swap)
    return figures


def computed_quantities() -> Quantities:
    """Figures that need no measurement."""
    growth = [computed(sorted_evidence(number), f"N = {number}") for number in (2, 10, 100)]
    return {"resamplings": resamplings(), "unaltered": growth}


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
    errors = [
        part._replace(what=f"N = {number}, {part.what}")
        for number in FIGURE_8_PARTICLES
        for part in gains("smooth", FIGURE_8_PARTS, number, "error")
    ]
    return {
        f"{prefix}error": errors,
        f"{prefix}variance": gains("smooth", FIGURE_8_PARTS, FIGURE_9_PARTICLES, "variance"),
        f"{prefix}strong_start": gains("strong_start", PARTS, FIGURE_10_PARTICLES, "error"),
        f"{prefix}erratic_error": erratic("error"),
        f"{prefix}erratic_variance": erratic("variance"),
    }


def sorted_evidence(num_particles: int) -> float:
    """Mean evidence estimate of the sorted swap over the exact evidence, over all draws.

    The particles share a parent; each of their two arms fits (likelihood 1) or not (0), with equal
    chances, so that the evidence is 1/4.  Sorted, as many particles fit as arms of the rarer side:
    4 E[min(L, R)] / N with binomial L and R, which is 1.25 for two particles and grows to 2.
    """
    counts = np.arange(num_particles + 1)
    chances = [math.comb(num_particles, count) / 2**num_particles for count in counts]
    fitting = np.minimum.outer(counts, counts)
    return float(4 * np.einsum("i,j,ij", chances, chances, fitting) / num_particles)


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
