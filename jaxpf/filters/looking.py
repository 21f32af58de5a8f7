"""The option to look for objects that are probably lost, which several filters have."""

from typing import Any

from jaxpf.contract.errors import InputError
from jaxpf.contract.options import option, plain


def relocate_option() -> Any:
    """Probability per frame that an object that is lost for certain is anywhere."""
    return option(
        0.0,
        "Probability per frame that an object that is lost for certain is anywhere in the frame; "
        "0 for never.  Of likelihoods that tell who is lost, such as discriminative appearance.",
        least=0,
        most=1,
        compiles=True,
    )


def relocation_of(likelihood: Any, epsilon: float) -> Any:
    """The settings for the frames that a likelihood knows; None where nothing is relocated.

    Raises:
        InputError: it cannot tell who is lost.
    """
    if epsilon == 0:
        return None
    from jaxpf.contract import has_log_odds
    from jaxpf.filters.relocation import relocation_in

    if not has_log_odds(likelihood) or not hasattr(likelihood, "frame_shape"):
        raise InputError(
            f"--relocate {plain(epsilon)} looks for objects that are lost, and this likelihood "
            "cannot tell who is; choose the appearance discriminative, or leave it out."
        )
    return relocation_in(likelihood.frame_shape, epsilon)
