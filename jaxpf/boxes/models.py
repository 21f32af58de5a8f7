"""Models of boxes for any likelihood."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from jaxpf.contract.errors import InputError
from jaxpf.contract.model import Model
from jaxpf.contract.numbers import plain
from jaxpf.contract.types import LikelihoodLike
from jaxpf.dynamics.relative import PixelMotion, RelativeMotion

#: Noise of centre (pixels) and scale per frame: wide enough for walking people in video.
DEFAULT_SCALE = (4.0, 2.0, 0.003)
#: The same relative to the size: usual steps, long steps, and the logarithm of the size.
DEFAULT_STEPS = (0.045, 0.18, 0.02)
#: The same for a single object.  Longer steps find an object that jumps; with several objects,
#: they lead to look-alikes.
LONE_STEPS = (0.045, 0.6, 0.02)
#: Share of the last displacement that is repeated.
DEFAULT_MOMENTUM = 0.3


def box_model(
    likelihood: LikelihoodLike,
    boxes: ArrayLike,
    scale: ArrayLike = DEFAULT_SCALE,
    *,
    steps: ArrayLike | None = None,
    momentum: ArrayLike = DEFAULT_MOMENTUM,
) -> Model:
    """Boxes that move from their start in pixels, or by steps relative to their size.

    Args:
        likelihood: of substates (u, v, a), such as ``jaxpf.likelihoods.histogram(...)``.
        boxes: x, y, w, h in pixels, ``[P, 4]``: where the objects are before the first frame.
        scale: noise of u, v (pixels) and a per frame, ``[3]`` or ``[P, 3]``, see
            ``jaxpf.dynamics.relative.PixelMotion``.
        steps: instead, ``[3]`` or ``[P, 3]``, see ``jaxpf.dynamics.relative.RelativeMotion``.
        momentum: of relative motion, ``[]`` or ``[P]``.
    """
    boxes = np.asarray(boxes, np.float32).reshape(-1, 4)
    dynamics: PixelMotion | RelativeMotion
    if steps is None:
        dynamics = PixelMotion(scale=np.asarray(scale, np.float32), sizes=boxes[:, 2:])
    else:
        dynamics = RelativeMotion(
            sizes=boxes[:, 2:],
            steps=np.asarray(steps, np.float32),
            momentum=np.asarray(momentum, np.float32),
        )
    centres = boxes[:, :2] + boxes[:, 2:] / 2
    initial = np.concatenate([centres, np.ones((len(boxes), 1), np.float32)], axis=1)
    return Model(dynamics, likelihood, initial, (-1,) * len(boxes))


def relative_steps(values: Sequence[float] | None, count: int) -> np.ndarray:
    """Convert the option ``noise_relative`` for P = ``count`` objects to ``[3]`` or ``[P, 3]``."""
    if values is None:
        values = LONE_STEPS if count == 1 else DEFAULT_STEPS
    steps = np.reshape(values, (-1, 3))
    if len(steps) not in (1, count):
        raise InputError(
            f"noise_relative {plain(values)} is for {len(steps)} objects, and there are {count}; "
            "give three numbers for all, or three for every object."
        )
    return steps if len(steps) > 1 else steps[0]


def reach_of(steps: np.ndarray) -> float:
    """Distance that particles hardly ever move from the last estimate, in sizes of the object.

    Args:
        steps: ``[3]`` or ``[P, 3]``.
    """
    # 4.3 standard deviations: 1 of 60 000 draws is longer.  The rest is momentum and spread.
    return float(4.3 * np.max(steps[..., 1]) + 0.4)


def boxes_at(estimate: ArrayLike, sizes: ArrayLike) -> np.ndarray:
    """Convert substates (u, v, a) to boxes x, y, w, h ``[..., P, 4]``.

    It uses NumPy, so that every caller gets bitwise equal results.

    Args:
        estimate: ``[..., P, D]``.
        sizes: ``[P, 2]``, width and height at scale 1, pixels.
    """
    estimate = np.asarray(estimate)
    extent = estimate[..., 2:3] * np.asarray(sizes).astype(estimate.dtype)
    return np.concatenate([estimate[..., :2] - extent / 2, extent], axis=-1)
