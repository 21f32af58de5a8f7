"""The labelled filter's options, for commands and evaluations."""

import dataclasses
from collections.abc import Sequence
from typing import Any

from jaxpf.contract.errors import Argument, InputError
from jaxpf.contract.model import Model
from jaxpf.contract.names import SCHEMES
from jaxpf.contract.options import check_options, option
from jaxpf.filters.filter import Filter
from jaxpf.filters.relocation_option import relocate_option, relocation_of

METHODS = ("labelled",)


@dataclasses.dataclass(frozen=True)
class Options:
    """Options of the labelled filter; see the help of each.

    These defaults track best.  Those of ``Labelled`` enable only the equal shares.
    """

    method: str = option("labelled", "labelled (each particle holds one object).", choices=METHODS)
    particles: int = option(
        300, "Number of particles.", least=1, most=2**31 - 1, flags=("-n",), compiles=True
    )
    resampling: str = option("systematic", "Resampling scheme.", choices=SCHEMES, compiles=True)
    weights: str = option(
        "equal_share",
        "How labelled particles are shared: equal_share (each object gets as many), plain (the "
        "likelier, the more), corrected (equal shares, weights kept).",
        choices=("equal_share", "plain", "corrected"),
        compiles=True,
    )
    scope: str = option(
        "across",
        "Whether labelled particles are resampled across objects or within each.",
        choices=("across", "within"),
        compiles=True,
    )
    feedback: str = option(
        "none",
        "Whether labelled particles move at their own speed (none) or at that of the estimate.",
        choices=("none", "estimate"),
        compiles=True,
    )
    regularise: tuple[float, ...] | None = option(
        None,
        "Rates of position and speed in the regularised estimates of labelled particles, such as "
        "0.9,0.5; by default they are not regularised.",
        kind=float,
        length=2,
        above=0,
        most=1,
        path="regularise",
    )
    relocate: float = relocate_option()

    def __post_init__(self) -> None:
        check_options(self)


class _LabelledFilter(Filter):
    """The labelled filter (rowe2005)."""

    name = "labelled"
    methods = METHODS
    options = Options
    opens = True

    def tracker(self, model: Model, options: Options) -> Any:
        import numpy as np

        from jaxpf.filters.labelled.tracker import Labelled

        self.check(options, model.parents)
        rates = options.regularise
        return Labelled(
            dynamics=model.dynamics,
            likelihood=model.likelihood,
            initial=model.initial,
            num_targets=model.num_partitions,
            num_particles=options.particles,
            resampling=options.resampling,
            weights=options.weights,
            scope=options.scope,
            feedback=options.feedback,
            relocation=relocation_of(model.likelihood, options.relocate),
            population="open" if model.is_open else "fixed",
            regularise=None if rates is None else np.asarray(rates, np.float32),
        )

    def admits(self, method: str, parents: Sequence[int]) -> bool:
        """Objects have no parents, as each particle holds one object."""
        return all(parent < 0 for parent in parents)

    def check(self, options: Options, parents: Sequence[int]) -> None:
        if not self.admits(options.method, parents):
            raise InputError(
                "method 'labelled' tracks independent objects, and these are parts of a tree; use "
                "method 'ps' or 'sps'."
            )
        if options.particles < len(parents):
            raise InputError(
                Argument("particles", options.particles),
                f" is fewer than the {len(parents)} objects that share them; give at least one "
                "each, better some fifty.",
            )

    def check_first(self, summary: Any, ids: Sequence[Any]) -> None:
        from jaxpf.filters.labelled.refusals import check_started

        check_started(summary, ids)


LABELLED = _LabelledFilter()
