"""Boxes: upright rectangles, one for each object."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from jaxpf.boxes.models import (
    boxes_at,
)
from jaxpf.boxes.target import BOXES
from jaxpf.contract.errors import InputError
from jaxpf.targets import building


def tracker(
    frame: Any,
    boxes: ArrayLike,
    *,
    method: str | None = None,
    particles: int | None = None,
    likelihood: Any = None,
    ordering: Any = None,
    patches: Any = None,
    **options: Any,
) -> Any:
    """The tracker of ``jaxpf track``: what it does by default, unless options say otherwise.

    Appearance is learned in the start frame and motion is relative to the objects' size.

    Args:
        frame: uint8 RGB ``[H, W, 3]``, in which the boxes are; tracking goes on with the next one.
            It may be None where the likelihood is one of your own.
        boxes: x, y, w, h in pixels, ``[P, 4]``.
        method: ``"dps"`` (default), ``"sir"``, ``"ps"``, ``"sps"``, ``"labelled"``, ...
        particles: their number; default 300.
        likelihood: one of your own, of substates (u, v, a): the centre in pixels, and the size
            relative to the start; or the name of the way to compute histograms.
        ordering: from ``jaxpf.ordering``, instead of a method.
        patches: P pictures, uint8 RGB ``[h, w, 3]``, from which colours are learned instead of
            from the frame.
        options: named as the flags of ``jaxpf track``, which tells what they mean: ``appearance``,
            ``motion``, ``relative_scale``, ``sharpness``, ``scale``, ``resampling``, ...

    Raises:
        InputError: an option that there is not, or a value out of range; the sentence says which.
    """
    given = {"method": method, "particles": particles, **options}
    own = {"likelihood": likelihood, "ordering": ordering, "patches": patches}
    return building.make(BOXES, frame, _start(boxes), given, **own)


def shapes(tracker: Any, estimate: ArrayLike) -> np.ndarray:
    """Boxes x, y, w, h in pixels, ``[..., P, 4]``, of estimates ``[..., P, D]``.

    Args:
        tracker: from ``tracker``.
        estimate: such as ``summary.estimate``.

    Raises:
        InputError: a tracker that does not know the sizes.
    """
    sizes = getattr(tracker.dynamics, "sizes", None)
    if sizes is None:
        raise InputError(
            "this tracker's dynamics do not know the sizes of the boxes; make it with "
            "jaxpf.boxes.tracker, or use jaxpf.shapes.boxes_from_substates(estimate, sizes)."
        )
    return boxes_at(estimate, sizes)


def _start(boxes: ArrayLike) -> Any:
    array = np.asarray(boxes, np.float64)
    if array.ndim != 2 or array.shape[1] != 4 or len(array) == 0:
        raise InputError(f"boxes has shape {list(array.shape)}: give a row x, y, w, h for each.")
    for number, box in enumerate(array):
        if not (np.isfinite(box).all() and (box[2:] > 0).all()):
            raise InputError(
                f"boxes[{number}] is {box.tolist()}: give x, y, and a positive width and height."
            )
    return BOXES.start(array)
