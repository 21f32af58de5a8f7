"""Options of the partitioned filter."""

import dataclasses
from typing import Any

from jaxpf.contract.errors import InputError
from jaxpf.contract.names import METHODS, SCHEMES, SWAPS
from jaxpf.contract.options import check_options, option


@dataclasses.dataclass(frozen=True)
class Options:
    """Options of SIR, PS, DPS and SPS; see the help of each."""

    method: str = option(
        "dps",
        "sir (bootstrap filter, all objects at once), ps (one after another), dps (ps in as many "
        "orders as there are objects; not for part trees), sps (side by side, then exchanged "
        "between particles).",
        choices=METHODS,
        common=True,
    )
    order: Any = option(  # noqa: RUF009
        None,
        "Order of the objects for ps, counted from 1, such as 3,1,2.",
        kind=int,
        length=-1,
        least=0,
        places=True,
    )
    swap: str = option(
        "combinatorial",
        "How sps exchanges parts between particles: combinatorial (unbiased), sorted (as "
        "published in 2011; biased), random or none.",
        choices=SWAPS,
        implies=("method", "sps"),
    )
    num_particles: int = option(
        300,
        "Number of particles.",
        least=1,
        most=2**31 - 1,
        flags=("-n",),
        common=True,
        compiles=True,
    )
    resampling: str = option("systematic", "Resampling scheme.", choices=SCHEMES, compiles=True)
    ess_threshold: float | None = option(
        None,
        "Resample only if the effective sample size is at most this share of the particles; by "
        "default always.",
        kind=float,
        least=0,
        most=1,
    )
    joint_weighting: bool = option(
        False,
        "Weight each object by the joint likelihood, with the others as predicted; for objects "
        "that exclude one another, such as contours.",
        compiles=True,
    )

    def __post_init__(self) -> None:
        check_options(self)
        if self.order is not None and self.method != "ps":
            raise InputError(
                f"an order was given, but method {self.method!r} has none; use method 'ps'."
            )
