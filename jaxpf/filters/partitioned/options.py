"""Options of the partitioned filter."""

import dataclasses
from typing import Annotated

from jaxpf.contract.names import METHODS, SCHEMES, SWAPS
from jaxpf.contract.options import Option, check_options


@dataclasses.dataclass(frozen=True)
class Options:
    """Options of SIR, PS, DPS and SPS; see the help of each."""

    method: Annotated[
        str,
        Option(
            "sir (bootstrap filter, all objects at once), ps (one after another), dps (ps in as "
            "many orders as there are objects; not for part trees), sps (side by side, then "
            "exchanged between particles).",
            choices=METHODS,
            common=True,
        ),
    ] = "dps"
    order: Annotated[
        tuple[int, ...] | None,
        Option(
            "Order of the objects for ps, counted from 1, such as 3,1,2.",
            length=-1,
            least=0,
            places=True,
            needs=("method", "ps"),
        ),
    ] = None
    swap: Annotated[
        str,
        Option(
            "How sps exchanges parts between particles: combinatorial (unbiased), sorted (as "
            "published in 2011; biased), random or none.",
            choices=SWAPS,
            needs=("method", "sps"),
        ),
    ] = "combinatorial"
    num_particles: Annotated[
        int,
        Option(
            "Number of particles.",
            least=1,
            most=2**31 - 1,
            flags=("-n",),
            common=True,
            compiles=True,
        ),
    ] = 300
    resampling: Annotated[str, Option("Resampling scheme.", choices=SCHEMES, compiles=True)] = (
        "systematic"
    )
    ess_threshold: Annotated[
        float | None,
        Option(
            "Resample only if the effective sample size is at most this share of the particles; by "
            "default always.",
            least=0,
            most=1,
        ),
    ] = None
    joint_weighting: Annotated[
        bool,
        Option(
            "Weight each object by the joint likelihood, with the others as predicted; for objects "
            "that exclude one another, such as contours.",
            compiles=True,
        ),
    ] = False

    def __post_init__(self) -> None:
        check_options(self)
