"""The system of rowe2005: labelled particles, pixels under a box, and speed feedback."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from jaxpf.contract.errors import InputError
from jaxpf.dynamics.gaussian import FirstOrder
from jaxpf.filters.labelled.tracker import Labelled
from jaxpf.likelihoods.pixels import pixels


class Rowe2005Settings(NamedTuple):
    """Settings that the paper leaves open.

    Attributes:
        position_scale: noise xi_x, pixels per frame.
        speed_scale: noise xi_u, pixels per frame squared.
        size_scale: noise xi_w of width and height, pixels per frame.
        sigma: width of the pixels' Gaussians, grey levels.
        min_slope: minimum slope of the overlap's power (eq. 8), per pixel.
        size_term: exponent of the size term (eq. 7).
        rates: a_x and a_u of the regularisation.
    """

    position_scale: float = 1.5
    speed_scale: float = 0.02
    size_scale: float = 1.2
    sigma: float = 50.0
    min_slope: float = 1.0
    size_term: float = 0.5
    rates: tuple[float, float] = (0.7, 0.2)


def rowe2005_tracker(
    frame: ArrayLike | None,
    boxes: ArrayLike,
    *,
    patches: Sequence[np.ndarray] | None = None,
    pool: str = "mean",
    **options: Any,
) -> Labelled:
    """Build the tracker of rowe2005, eq. 2 to 8, or a variant of it.

    A substate is (u, v, w, h, du, dv): centre and sides of a box in pixels, and speed in pixels
    per frame.  Targets start at rest.

    Args:
        frame: uint8 RGB ``[H, W, 3]`` that contains the boxes.
        boxes: x, y, w, h in pixels, ``[P, 4]``.
        patches: P pictures, uint8 RGB ``[h, w, 3]``, from which appearance is learned instead of
            from the frame.
        pool: how pixels are combined; ``"mean"`` is eq. 3, ``"product"`` is common.
        options: fields of ``Rowe2005Settings``, and of ``jaxpf.Labelled``, such as ``weights``
            (eq. 4), ``feedback``, ``resampling``, ``num_particles``.

    Raises:
        InputError: an option is unknown or out of range.
    """
    if options.keys() & {"method", "likelihood", "ordering"}:
        raise InputError("rowe2005 has a method and likelihood of its own; leave those out.")
    own = {name: options.pop(name) for name in Rowe2005Settings._fields if name in options}
    settings = Rowe2005Settings(**own)
    boxes = np.asarray(boxes, np.float32)
    if patches is None:
        from scenes import cut_patch

        patches = [cut_patch(np.asarray(frame), box) for box in boxes]
    likelihood = pixels(
        patches,
        sigma=settings.sigma,
        window=(8, 12),
        pool=pool,
        colour="grey",
        min_slope=settings.min_slope,
        size_term=settings.size_term,
    )
    initial = np.hstack(
        [boxes[:, :2] + boxes[:, 2:] / 2, boxes[:, 2:], np.zeros_like(boxes[:, :2])]
    )
    scales = (settings.position_scale, settings.size_scale, settings.speed_scale)
    defaults: dict[str, Any] = {
        "num_particles": 100,
        "resampling": "multinomial",
        "feedback": "estimate",
        "speed": (4, 5),
    }
    return Labelled(
        dynamics=FirstOrder(scale=np.repeat(np.array(scales, np.float32), 2), speed=(4, 5)),
        likelihood=likelihood,
        initial=initial,
        regularise=np.array(settings.rates, np.float32),
        **(defaults | options),
    )
