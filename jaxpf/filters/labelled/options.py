"""Options of the labelled filter."""

import dataclasses
from typing import Annotated

from jaxpf.contract.names import SCHEMES
from jaxpf.contract.options import Option, check_options

METHODS = ("labelled",)


@dataclasses.dataclass(frozen=True)
class Options:
    """Options of the labelled filter; see the help of each.

    These defaults track best.  Those of ``Labelled`` enable only the equal shares.
    """

    method: Annotated[
        str, Option("labelled (each particle holds one object).", choices=METHODS)
    ] = "labelled"
    num_particles: Annotated[
        int, Option("Number of particles.", least=1, most=2**31 - 1, flags=("-n",), compiles=True)
    ] = 300
    resampling: Annotated[str, Option("Resampling scheme.", choices=SCHEMES, compiles=True)] = (
        "systematic"
    )
    weights: Annotated[
        str,
        Option(
            "How labelled particles are shared: equal_share (the same number for each object, as "
            "published; biases the evidence), plain (in proportion to their likelihoods), "
            "corrected (equal shares, weights kept).",
            choices=("equal_share", "plain", "corrected"),
            compiles=True,
        ),
    ] = "equal_share"
    feedback: Annotated[
        str,
        Option(
            "Whether labelled particles move at their own speed (none) or at that of the estimate.",
            choices=("none", "estimate"),
            compiles=True,
        ),
    ] = "none"
    regularise: Annotated[
        tuple[float, ...] | None,
        Option(
            "Rates of position and speed in the regularised estimates of labelled particles, such "
            "as 0.9,0.5; by default they are not regularised.",
            length=2,
            above=0,
            most=1,
            path="regularise",
        ),
    ] = None

    def __post_init__(self) -> None:
        check_options(self)
