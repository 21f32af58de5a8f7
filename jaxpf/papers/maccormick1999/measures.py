"""Measures of the experiment, by the names in ``claims.csv``."""

from collections.abc import Callable, Mapping

import numpy as np

from jaxpf.papers.judging.claims import Quantity, computed
from jaxpf.papers.judging.measures import Measure
from jaxpf.papers.maccormick1999 import one_line
from jaxpf.papers.maccormick1999.passing import Measurement


def of_line() -> Quantity:
    """Figure 3, which is deterministic: ratio of the peaks on the diagonal to those beside it."""
    together, apart = one_line.peaks()
    return computed(float(together.max() / apart.min()))


def _of(kind: str, what: str) -> Callable[[Measurement, str], np.ndarray]:
    """A method of ``Passing`` on one kind of sequences."""

    def values(measured: Measurement, variant: str) -> np.ndarray:
        return getattr(getattr(measured, kind), what)(variant)

    return values


def _labels_right(kind: str) -> Callable[[Measurement, str], np.ndarray]:
    """Frames with strong overlap in which the label has the depth order right, ``[cases, 1]``."""
    return lambda measured, variant: getattr(measured, kind).labels_right(variant)[:, None]


def of_kind(kind: str) -> dict[str, Measure]:
    """The measures of wires, leaves, walkers or the leaves of figure 11."""
    return {
        "kept": Measure(_of(kind, "kept"), "percent"),
        "coalesced": Measure(_of(kind, "coalesced"), "percent"),
        "exchanged": Measure(_of(kind, "swapped"), "percent"),
        "label right": Measure(_labels_right(kind), "percent"),
        "widening": Measure(_of(kind, "widening"), "ratio", digits=2),
        "narrowing": Measure(_of(kind, "narrowing"), "ratio", digits=2),
        "ess": Measure(_of(kind, "ess"), "ratio", digits=1),
    }


MEASURES: Mapping[str, Measure] = {
    **{
        f"{kind}: {name}": measure
        for kind in ("wires", "leaves", "walkers", "figure_11")
        for name, measure in of_kind(kind).items()
    },
    # Figures 9 and 10: the last step's effective sample size.
    "toy: ess": Measure(lambda measured, variant: measured.toy[variant][-1].ess, "ratio"),
}
