"""The factored filters' options."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from jaxpf.contract.errors import InputError
from jaxpf.contract.model import Model
from jaxpf.contract.names import SCHEMES
from jaxpf.contract.options import check_options, option
from jaxpf.filters.filter import Filter

_METHODS = ("eskil", "pffl")
#: Published numbers of particles per partition.
_PARTICLES = {"eskil": 10, "pffl": 50}
_UPSAMPLING = {"eskil": 3, "pffl": 1}
_ESKIL = ("method", "eskil")


@dataclasses.dataclass(frozen=True)
class Options:
    """Options of eskil and pffl; see the help of each."""

    method: str = option(
        "eskil",
        "eskil (every object has its own particles; objects drift together and keep a shape), "
        "pffl (the same without drift and shape).",
        choices=_METHODS,
    )
    particles: int | None = option(
        None,
        "For eskil and pffl, of each object: 10 and 50 unless given.",
        kind=int,
        least=1,
        most=2**31 - 1,
        flags=("-n",),
        compiles=True,
    )
    resampling: str = option("systematic", "Resampling scheme.", choices=SCHEMES, compiles=True)
    upsampling: int | None = option(
        None,
        "Moves per particle; by default 3 for eskil and 1 for pffl.",
        kind=int,
        least=1,
        most=1000,
        compiles=True,
    )
    drift: str = option(
        "clip",
        "How objects move together (eskil only).",
        choices=("clip", "signed", "literal", "ridge", "none"),
        compiles=True,
        implies=_ESKIL,
    )
    shape: str = option(
        "relative",
        "How objects keep their distances (eskil only).",
        choices=("relative", "pixels", "none"),
        compiles=True,
        implies=_ESKIL,
    )
    shape_scale: float = option(
        0.1,
        "Tolerated stretch of distances between objects: a share, or pixels (eskil only).",
        above=0,
        path="shape_scale",
        implies=_ESKIL,
    )
    velocity_memory: int = option(
        10,
        "Frames over which velocities are compared (eskil only).",
        least=2,
        most=1000,
        compiles=True,
        implies=_ESKIL,
    )
    proper: bool = option(
        False,
        "Whether the drift is a proposal instead of part of the dynamics (eskil only).",
        compiles=True,
        implies=_ESKIL,
    )
    form: str = option(
        "auxiliary",
        "How pffl weights: as a sound auxiliary particle filter, or literally as published.",
        choices=("auxiliary", "literal"),
        compiles=True,
        implies=("method", "pffl"),
    )

    def __post_init__(self) -> None:
        check_options(self)


class _FactoredFilter(Filter):
    """The factored filters, with separate particles per partition: PFFL and eskil2014."""

    name = "factored"
    methods = _METHODS
    options = Options

    def tracker(self, model: Model, options: Options) -> Any:
        from jaxpf.dynamics.gaussian import AR2
        from jaxpf.filters.factored.eskil import Eskil
        from jaxpf.filters.factored.pffl import PFFL

        self.check(options, model.parents)
        method = options.method
        shared: dict[str, Any] = {
            "dynamics": model.dynamics,
            "likelihood": model.likelihood,
            "initial": model.initial,
            "num_particles": options.particles or _PARTICLES[method],
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

    def admits(self, method: str, parents: Sequence[int]) -> bool:
        """No part trees, as partitions share no particles."""
        return all(parent < 0 for parent in parents)

    def check(self, options: Options, parents: Sequence[int]) -> None:
        if not self.admits(options.method, parents):
            raise InputError(
                f"method {options.method!r} follows independent objects, and this is a part tree; "
                "choose sir, ps or sps."
            )


FACTORED = _FactoredFilter()
