"""Coloured boxes tracked with labelled particles, and what is refused at their start.

A box is a target with substate (u, v, a), as in ``jaxpf.boxes``: centre in pixels and scale
relative to the size it started with.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from jaxpf.errors import InputError
from jaxpf.filters.labelled.tracker import Labelled
from jaxpf.targets.boxes import DEFAULT_SCALE, box_model

__all__ = ["check_in_frame", "labelled_box_tracker"]


def labelled_box_tracker(
    likelihood: Any,
    boxes: ArrayLike,
    *,
    scale: ArrayLike = DEFAULT_SCALE,
    num_particles: int = 300,
    resampling: str = "systematic",
    scope: str = "across",
    weights: str = "equal_share",
    feedback: str = "none",
    regularise: ArrayLike | None = None,
    reseed: ArrayLike | None = None,
    frame_shape: Sequence[int] | None = None,
) -> Labelled:
    """A labelled tracker that starts at given boxes and moves them by smith2004's AR2 dynamics.

    Feedback replaces a particle's last displacement by its target's estimated one.

    Args:
        likelihood: of substates (u, v, a), such as ``jaxpf.likelihoods.histogram(...)``.
        boxes: x, y, w, h in pixels, ``[L, 4]``: where the targets are before the first frame.
        scale: noise of u, v (pixels) and a per frame, ``[3]`` or ``[L, 3]``.
        num_particles: N, of all targets together.
        resampling: a scheme of ``jaxpf.resampling.SCHEMES``.
        scope: see ``Labelled``, as are ``weights``, ``feedback`` and ``regularise``.
        weights: see ``scope``.
        feedback: see ``scope``.
        regularise: see ``scope``.
        reseed: standard deviations of u, v and a around a lost target's last estimate.
        frame_shape: of a frame, (height, width, ...), to refuse boxes outside it.

    Raises:
        InputError: a box outside the frame; noise that is negative or not finite; and see
            ``Labelled``.
    """
    boxes = np.asarray(boxes, np.float32).reshape(-1, 4)
    if frame_shape is not None:
        check_in_frame(boxes, frame_shape)
    model = box_model(likelihood, boxes, scale)
    return Labelled(
        dynamics=model.dynamics,
        likelihood=model.likelihood,
        initial=model.initial,
        num_particles=num_particles,
        resampling=resampling,
        scope=scope,
        weights=weights,
        feedback=feedback,
        regularise=None if regularise is None else np.asarray(regularise, np.float32),
        reseed=None if reseed is None else np.asarray(reseed, np.float32),
    )


def check_in_frame(
    boxes: ArrayLike, frame_shape: Sequence[int], ids: Sequence[Any] | None = None
) -> None:
    """Refuse a target that nobody can see.

    Args:
        boxes: x, y, w, h in pixels, ``[L, 4]``.
        frame_shape: (height, width, ...).
        ids: what the targets are called; by default their numbers.

    Raises:
        InputError: a box that has no area, or none inside the frame.
    """
    height, width = frame_shape[:2]
    for number, (x, y, w, h) in enumerate(np.asarray(boxes, float).reshape(-1, 4)):
        name = number if ids is None else ids[number]
        if not (np.isfinite([x, y, w, h]).all() and w > 0 and h > 0):
            raise InputError(
                f"target {name} has the box {x:g},{y:g},{w:g},{h:g}, which has no area; give x, y, "
                "width and height in pixels."
            )
        if x >= width or y >= height or x + w <= 0 or y + h <= 0:
            raise InputError(
                f"target {name} has the box {x:g},{y:g},{w:g},{h:g}, which lies outside the frame "
                f"of {width} x {height} pixels; leave it out or start where it is in view."
            )
