"""Options of the factored filters."""

import dataclasses

from jaxpf.contract.names import SCHEMES
from jaxpf.contract.options import check_options, option

METHODS = ("eskil", "pffl")
_ESKIL = ("method", "eskil")


@dataclasses.dataclass(frozen=True)
class Options:
    """Options of eskil and pffl; see the help of each."""

    method: str = option(
        "eskil",
        "eskil (every object has its own particles; objects drift together and keep a shape; "
        "biased), pffl (the same without drift and shape, and without its authors' learned prior).",
        choices=METHODS,
    )
    num_particles: int | None = option(
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
        "The drift is a proposal instead of part of the dynamics (eskil only).",
        compiles=True,
        implies=_ESKIL,
    )
    form: str = option(
        "auxiliary",
        "How pffl weights: as a properly weighted auxiliary particle filter, or literally as "
        "published.",
        choices=("auxiliary", "literal"),
        compiles=True,
        implies=("method", "pffl"),
    )

    def __post_init__(self) -> None:
        check_options(self)
