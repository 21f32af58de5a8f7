"""The labelled filter as a family, for commands and evaluations."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from jaxpf.contract.errors import Argument, InputError
from jaxpf.contract.model import Model
from jaxpf.filters.filter import Filter
from jaxpf.filters.labelled.options import METHODS, Options

if TYPE_CHECKING:
    from jaxpf.filters.labelled.tracker import Labelled


class _LabelledFilter(Filter):
    """The labelled filter (rowe2005)."""

    name = "labelled"
    methods = METHODS
    options = Options
    opens = True
    takes_trees = False  # each particle holds one object

    def tracker(self, model: Model, options: Options) -> "Labelled":
        import numpy as np

        from jaxpf.filters.labelled.tracker import Labelled

        self.check(vars(options), model.parents)
        rates = options.regularise
        return Labelled(
            dynamics=model.dynamics,
            likelihood=model.likelihood,
            initial=model.initial,
            num_targets=model.num_partitions,
            num_particles=options.num_particles,
            resampling=options.resampling,
            weights=options.weights,
            feedback=options.feedback,
            population="open" if model.is_open else "fixed",
            regularise=None if rates is None else np.asarray(rates, np.float32),
        )

    def check(self, values: Mapping[str, Any], parents: Sequence[int]) -> None:
        super().check(values, parents)
        if values["num_particles"] < len(parents):
            raise InputError(
                Argument("num_particles", values["num_particles"]),
                f" is fewer than the {len(parents)} objects that share them; give at least one "
                "each, better some fifty.",
            )


LABELLED = _LabelledFilter()
