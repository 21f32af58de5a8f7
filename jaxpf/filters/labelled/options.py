"""Options of the labelled filter."""

import dataclasses

from jaxpf.contract.names import SCHEMES
from jaxpf.contract.options import check_options, option

METHODS = ("labelled",)


@dataclasses.dataclass(frozen=True)
class Options:
    """Options of the labelled filter; see the help of each.

    These defaults track best.  Those of ``Labelled`` enable only the equal shares.
    """

    method: str = option("labelled", "labelled (each particle holds one object).", choices=METHODS)
    num_particles: int = option(
        300, "Number of particles.", least=1, most=2**31 - 1, flags=("-n",), compiles=True
    )
    resampling: str = option("systematic", "Resampling scheme.", choices=SCHEMES, compiles=True)
    weights: str = option(
        "equal_share",
        "How labelled particles are shared: equal_share (the same number for each object, as "
        "published; biases the evidence), plain (in proportion to their likelihoods), corrected "
        "(equal shares, weights kept).",
        choices=("equal_share", "plain", "corrected"),
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

    def __post_init__(self) -> None:
        check_options(self)
