"""The option ``relocate``, shared by several filters."""

from typing import TYPE_CHECKING, Any

from jaxpf.contract.errors import Argument, InputError, choice
from jaxpf.contract.options import option, plain

if TYPE_CHECKING:
    from jaxpf.contract.types import LikelihoodLike
    from jaxpf.filters.relocation import Relocation


def relocate_option() -> Any:
    """Chance per frame of searching the whole frame for a lost object."""
    return option(
        0.0,
        "Chance per frame of searching the whole frame for a lost object; 0 never does.  Needs a "
        "likelihood that reports a confidence and knows the frame, such as discriminative "
        "appearance of boxes.",
        least=0,
        most=1,
        compiles=True,
    )


def relocation_of(likelihood: "LikelihoodLike", epsilon: float) -> "Relocation | None":
    """Build the relocation for a likelihood's frames; None if ``epsilon`` is 0."""
    if epsilon == 0:
        return None
    from jaxpf.contract import has_log_odds, optional
    from jaxpf.filters.relocation import relocation_in

    frame_shape = optional(likelihood, "frame_shape")
    if not has_log_odds(likelihood) or frame_shape is None:
        raise InputError(
            Argument("relocate", plain(epsilon)),
            " searches for lost objects, and this likelihood does not report which are lost; use ",
            choice("appearance", "discriminative"),
            ", or leave relocate out.",
        )
    return relocation_in(frame_shape, epsilon)
