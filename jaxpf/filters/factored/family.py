"""The factored filters as a family, with separate particles per partition."""

import dataclasses
from typing import TYPE_CHECKING, Any

import numpy as np

from jaxpf.contract.model import Model
from jaxpf.filters.factored.options import METHODS, Options
from jaxpf.filters.filter import Filter

if TYPE_CHECKING:
    from jaxpf.filters.factored.eskil import Eskil
    from jaxpf.filters.factored.pffl import PFFL

#: Published numbers of particles per partition.
_PARTICLES = {"eskil": 10, "pffl": 50}
_UPSAMPLING = {"eskil": 3, "pffl": 1}


class _FactoredFilter(Filter):
    """The factored filters, with separate particles per partition: PFFL and eskil2014."""

    name = "factored"
    methods = METHODS
    options = Options
    takes_trees = False  # partitions share no particles

    def tracker(self, model: Model, options: Options) -> "PFFL | Eskil":
        from jaxpf.dynamics.gaussian import AR2
        from jaxpf.filters.factored.eskil import Eskil
        from jaxpf.filters.factored.pffl import PFFL

        self.check(vars(options), model.parents)
        method = options.method
        shared: dict[str, Any] = {
            "dynamics": model.dynamics,
            "likelihood": model.likelihood,
            "initial": model.initial,
            "num_particles": options.num_particles or _PARTICLES[method],
            "upsampling": options.upsampling or _UPSAMPLING[method],
            "resampling": options.resampling,
        }
        if method == "pffl":
            return PFFL(form=options.form, **shared)
        if options.drift != "none" and type(model.dynamics) is AR2:
            # Drift and momentum would count the same motion twice, and points would run away.
            shared["dynamics"] = dataclasses.replace(model.dynamics, momentum=np.float32(0))
        return Eskil(
            shape_scale=options.shape_scale,
            memory=options.velocity_memory,
            drift=options.drift,
            shape=options.shape,
            proper=options.proper,
            **shared,
        )


FACTORED = _FactoredFilter()
