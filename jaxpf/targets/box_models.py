"""Models and trackers of boxes for any likelihood."""

import dataclasses
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from jaxpf.errors import InputError
from jaxpf.models.model import Model
from jaxpf.targets.appearance import RELATIVE

if TYPE_CHECKING:
    from jaxpf.filters.partitioned.ordering import Ordering
    from jaxpf.filters.partitioned.tracker import Partitioned

#: Noise of centre (pixels) and scale per frame: wide enough for people walking in video.
DEFAULT_SCALE = (4.0, 2.0, 0.003)
#: The same relative to the size: usual steps, long ones, and the logarithm of the size.
DEFAULT_STEPS = (0.045, 0.18, 0.02)
#: Share of the last displacement that is repeated.
DEFAULT_MOMENTUM = 0.3


def box_model(likelihood: Any, boxes: ArrayLike, scale: ArrayLike = DEFAULT_SCALE) -> Model:
    """Boxes that start where they are and move by smith2004's AR2 dynamics.

    Args:
        likelihood: of substates (u, v, a), such as ``jaxpf.likelihoods.histogram(...)``.
        boxes: x, y, w, h in pixels, ``[P, 4]``: where the objects are before the first frame.
        scale: noise of u, v (pixels) and a per frame, ``[3]`` or ``[P, 3]``.

    Raises:
        InputError: noise that is negative or not finite.
    """
    from jaxpf.models.dynamics import AR2

    boxes = np.asarray(boxes, np.float32).reshape(-1, 4)
    scale = np.asarray(scale, np.float32)
    if scale.shape[-1:] != (3,) or not np.all(np.isfinite(scale)) or np.any(scale < 0):
        raise InputError(
            f"scale {scale.tolist()} must be three finite numbers >= 0: the noise of x and y in "
            "pixels and of the relative size, such as 4,2,0.003."
        )
    centres = boxes[:, :2] + boxes[:, 2:] / 2
    return Model(
        dynamics=AR2(scale=scale),
        likelihood=likelihood,
        initial=np.concatenate([centres, np.ones((len(boxes), 1), np.float32)], axis=1),
        parents=(-1,) * len(boxes),
    )


def relative_box_model(
    likelihood: Any,
    boxes: ArrayLike,
    steps: ArrayLike = DEFAULT_STEPS,
    momentum: ArrayLike = DEFAULT_MOMENTUM,
) -> Model:
    """Boxes that start where they are and move by steps relative to their size.

    Args:
        likelihood: see ``box_model``, like the next one.
        boxes: see there.
        steps: see ``jaxpf.dynamics.RelativeMotion``, ``[3]`` or ``[P, 3]``.
        momentum: see there, ``[]`` or ``[P]``.

    Raises:
        InputError: noise that is negative or not finite.
    """
    from jaxpf.models.relative_motion import RelativeMotion

    boxes = np.asarray(boxes, np.float32).reshape(-1, 4)
    steps = np.asarray(steps, np.float32)
    if steps.shape[-1:] != (3,) or not np.all(np.isfinite(steps)) or np.any(steps < 0):
        raise InputError(
            f"steps {steps.tolist()} must be three finite numbers >= 0: usual steps and long ones "
            "as shares of the size, and the noise of its logarithm, such as 0.045,0.18,0.02."
        )
    model = box_model(likelihood, boxes)
    momentum = np.asarray(momentum, np.float32)
    motion = RelativeMotion(sizes=boxes[:, 2:], steps=steps, momentum=momentum)
    return model._replace(dynamics=motion)


def motion_candidates(options: Any) -> list[Any]:
    """Options that differ in the motion: half and double steps, and, if relative, other momenta.

    Args:
        options: of boxes, what depends on the pictures being settled; they are the first.
    """
    found = [options]
    for factor in (0.5, 1.0, 2.0):
        if options.motion == RELATIVE:
            scaled = np.reshape(options.relative_scale, (-1, 3)) * [factor, factor, 1]
            noise = {"relative_scale": tuple(scaled.ravel().tolist())}
            momenta = [{"momentum": momentum} for momentum in (0.0, 0.3, 0.6, 0.9)]
        else:
            x, y, of_size = options.scale
            noise, momenta = {"scale": (factor * x, factor * y, of_size)}, [{}]
        found += [dataclasses.replace(options, **noise, **momentum) for momentum in momenta]
    return list(dict.fromkeys(found))


def box_tracker(
    likelihood: Any,
    boxes: ArrayLike,
    ordering: "Ordering",
    *,
    scale: ArrayLike = DEFAULT_SCALE,
    num_particles: int = 300,
    resampling: str = "systematic",
    ess_threshold: float | None = None,
) -> "Partitioned":
    """A partitioned filter of boxes, for any likelihood and ordering.

    Args:
        likelihood: see ``box_model``, like the next one and ``scale``.
        boxes: see there.
        ordering: from ``jaxpf.ordering``.
        scale: see there.
        num_particles: N.
        resampling: a scheme of ``jaxpf.resampling.SCHEMES``.
        ess_threshold: see ``Partitioned``.

    Raises:
        InputError: see ``box_model`` and ``check_tracker``.
    """
    from jaxpf.filters.partitioned.tracker import Partitioned

    return Partitioned(
        **box_model(likelihood, boxes, scale)._asdict(),
        ordering=ordering,
        num_particles=num_particles,
        resampling=resampling,
        ess_threshold=ess_threshold,
    )
