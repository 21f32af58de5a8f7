"""Options of the factored filters."""

import dataclasses
from typing import Annotated

from jaxpf.contract.names import SCHEMES
from jaxpf.contract.options import Option, check_options

METHODS = ("eskil", "pffl")
_ESKIL = ("method", "eskil")


@dataclasses.dataclass(frozen=True)
class Options:
    """Options of eskil and pffl; see the help of each."""

    method: Annotated[
        str,
        Option(
            "eskil (every object has its own particles; objects drift together and keep a shape; "
            "biased), pffl (the same without drift and shape, and without its authors' learned "
            "prior).",
            choices=METHODS,
        ),
    ] = "eskil"
    num_particles: Annotated[
        int | None,
        Option(
            "For eskil and pffl, of each object: 10 and 50 unless given.",
            least=1,
            most=2**31 - 1,
            flags=("-n",),
            compiles=True,
        ),
    ] = None
    resampling: Annotated[str, Option("Resampling scheme.", choices=SCHEMES, compiles=True)] = (
        "systematic"
    )
    upsampling: Annotated[
        int | None,
        Option(
            "Moves per particle; by default 3 for eskil and 1 for pffl.",
            least=1,
            most=1000,
            compiles=True,
        ),
    ] = None
    drift: Annotated[
        str,
        Option(
            "How objects move together (eskil only).",
            choices=("clip", "signed", "literal", "ridge", "none"),
            compiles=True,
            needs=_ESKIL,
        ),
    ] = "clip"
    shape: Annotated[
        str,
        Option(
            "How objects keep their distances (eskil only).",
            choices=("relative", "pixels", "none"),
            compiles=True,
            needs=_ESKIL,
        ),
    ] = "relative"
    shape_scale: Annotated[
        float,
        Option(
            "Tolerated stretch of distances between objects: a share, or pixels (eskil only).",
            above=0,
            path="shape_scale",
            needs=_ESKIL,
        ),
    ] = 0.1
    velocity_memory: Annotated[
        int,
        Option(
            "Frames over which velocities are compared (eskil only).",
            least=2,
            most=1000,
            compiles=True,
            needs=_ESKIL,
        ),
    ] = 10
    proper: Annotated[
        bool,
        Option(
            "The drift is a proposal instead of part of the dynamics (eskil only).",
            compiles=True,
            needs=_ESKIL,
        ),
    ] = False
    form: Annotated[
        str,
        Option(
            "How pffl weights: as a properly weighted auxiliary particle filter, or literally as "
            "published.",
            choices=("auxiliary", "literal"),
            compiles=True,
            needs=("method", "pffl"),
        ),
    ] = "auxiliary"

    def __post_init__(self) -> None:
        check_options(self)
