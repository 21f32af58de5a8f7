"""Figures that need no measurement."""

import math

import numpy as np

from jaxpf.measures import particle_sets
from jaxpf.ordering import named
from jaxpf.papers.gonzales2011.scenes import FIGURES
from jaxpf.papers.judging.estimates import Quantity, computed


def computed_quantities() -> dict[str, list[Quantity]]:
    """Key of a claim -> its figures."""
    growth = [computed(sorted_evidence(number), f"N = {number}") for number in (2, 10, 100)]
    return {"resamplings": resamplings(), "unaltered": growth}


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
    for num_parts in FIGURES["figure 8"][2]:
        tree = [-1 if part == 0 else max(part - 2, 0) for part in range(num_parts)]
        ps, sps = (
            int(particle_sets.resamplings_per_frame(named(method, tree).resample_after))
            for method in ("ps", "sps")
        )
        figures.append(computed(ps / sps, f"{num_parts} parts, {ps} / {sps}"))
    return figures
