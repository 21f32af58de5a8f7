"""The figures that judge the paper's claims, by the claims' keys."""

from collections.abc import Mapping, Sequence

import numpy as np

from jaxpf.papers.judging.claims import Quantity, computed
from jaxpf.papers.judging.estimates import gap_of, ratio_of, share_of
from jaxpf.papers.maccormick1999 import one_line, toy
from jaxpf.papers.maccormick1999.measure import Measurement
from jaxpf.papers.maccormick1999.passing import (
    AS_MANY,
    CONDENSATION,
    ENOUGH,
    EXCLUSIVE,
    INDEPENDENT,
    NAIVE,
    OCCLUSION,
    PARTITIONED,
    PRINTED,
    PUBLISHED_FLIP,
    Passing,
)
from jaxpf.papers.maccormick1999.tables import rate_of_labels

Quantities = dict[str, Quantity]


def quantities(measured: Measurement) -> dict[str, list[Quantity]]:
    """Key of a claim -> its figures; methods that were not run are omitted."""
    figures = {
        "toy": of_toy(measured.toy),
        **of_wires(measured.wires),
        **of_leaves(measured.leaves),
        **of_walkers(measured.walkers),
        "leaves_ess": of_figure_11(measured.figure_11),
    }
    return {key: [figure] for key, figure in figures.items()}


def of_line() -> Quantity:
    """Figure 3, which is deterministic: ratio of the peaks on the diagonal to those beside it."""
    together, apart = one_line.peaks()
    return computed(float(together.max() / apart.min()))


def of_toy(steps: Mapping[str, Sequence[toy.Step]]) -> Quantity:
    """Figures 9 and 10: the ratio of the effective sample sizes."""
    conventional, branched = (steps[method][-1].ess for method in (toy.CONVENTIONAL, toy.BRANCHED))
    return ratio_of(branched, conventional)


def of_wires(wires: Passing) -> Quantities:
    """Figure 4: exclusion keeps the targets apart; without it they coalesce."""
    naive, exclusive = (each + CONDENSATION for each in (NAIVE, EXCLUSIVE))
    return {
        "wires_condensation_kept": share_of(wires.kept(exclusive)),
        "wires_printed": share_of(wires.kept(EXCLUSIVE + PRINTED + CONDENSATION)),
        "wires_condensation": _gap(wires.coalesced(naive), wires.coalesced(exclusive)),
        "wires_kept": share_of(wires.kept(EXCLUSIVE)),
        "wires_fewer_kept": _gap(wires.kept(EXCLUSIVE), wires.kept(NAIVE)),
        "wires_coalesce": _gap(wires.coalesced(NAIVE), wires.coalesced(EXCLUSIVE)),
    }


def of_leaves(passing: Passing) -> Quantities:
    """Figure 7, and the same by ordinary Condensation."""
    figures = {
        "leaves_kept": share_of(passing.kept(PARTITIONED)),
        "leaves_labels": rate_of_labels(passing, PARTITIONED),
    }
    if PARTITIONED + PUBLISHED_FLIP in passing.methods:
        figures["leaves_labels_flip"] = rate_of_labels(passing, PARTITIONED + PUBLISHED_FLIP)
    if (printed := PARTITIONED + PRINTED) in passing.methods:
        figures["leaves_printed"] = share_of(passing.kept(printed))
        figures["leaves_paid_once"] = _gap(passing.kept(PARTITIONED), passing.kept(printed))
    if ENOUGH in passing.methods:
        figures["leaves_enough"] = share_of(passing.kept(ENOUGH))
    return figures


def of_figure_11(passing: Passing) -> Quantity:
    """Ratio of effective sample sizes, averaged over the first frames."""
    return ratio_of(passing.ess(PARTITIONED), passing.ess(AS_MANY))


def of_walkers(passing: Passing) -> Quantities:
    """Figures 1 and 6."""
    figures = {
        "walkers_coalesce": _gap(passing.coalesced(INDEPENDENT), passing.coalesced(OCCLUSION)),
        "walkers_condensation": share_of(passing.kept(OCCLUSION)),
        "walkers_widen": ratio_of(passing.widening(OCCLUSION), 1.0),
        "walkers_narrow": ratio_of(passing.narrowing(OCCLUSION), 1.0),
    }
    if (printed := OCCLUSION + PRINTED) in passing.methods:
        figures["walkers_printed"] = share_of(passing.kept(printed))
    return figures


def _gap(first: np.ndarray, second: np.ndarray) -> Quantity:
    """First rate minus second rate in points, on the sequences that both have."""
    number = min(len(first), len(second))
    return gap_of(first[:number], second[:number])
