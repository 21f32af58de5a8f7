"""Measures of the experiment, by the names in ``claims.csv``."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from jaxpf.papers.judging.claims import Quantity, computed
from jaxpf.papers.judging.measures import Measure
from jaxpf.papers.maccormick1999 import one_line
from jaxpf.papers.maccormick1999.passing import Passing
from jaxpf.papers.maccormick1999.published import FIRST_FRAMES


def of_line() -> Quantity:
    """Figure 3, which is deterministic: ratio of the peaks on the diagonal to those beside it."""
    together, apart = one_line.peaks()
    return computed(float(together.max() / apart.min()))


def of_kind(kind: str) -> dict[str, Measure]:
    """The measures of wires, leaves, walkers or the leaves of figure 11."""

    def of(values: Callable[[Passing, str], np.ndarray], *how: Any) -> Measure:
        return Measure(lambda measured, method: values(getattr(measured, kind), method), *how)

    def share_of(field: str) -> Measure:
        return of(lambda passing, method: passing.of(field, method), "percent")

    return {
        "kept": share_of("kept"),
        "coalesced": share_of("coalesced"),
        "exchanged": share_of("swapped"),
        "label right": of(lambda passing, method: passing.labels_right(method)[:, None], "percent"),
        "widening": of(Passing.widening, "ratio", 2),
        "narrowing": of(Passing.narrowing, "ratio", 2),
        # Over the first frames.
        "ess": of(
            lambda passing, method: passing.of("ess", method)[..., :FIRST_FRAMES].mean(axis=(1, 2)),
            "ratio",
            1,
        ),
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
