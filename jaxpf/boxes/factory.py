"""Builds trackers of boxes: one upright rectangle per object."""

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from jaxpf.boxes.models import boxes_at
from jaxpf.boxes.rowe2005 import rowe2005_tracker
from jaxpf.boxes.target import BOXES
from jaxpf.contract.errors import InputError, check_tracker
from jaxpf.contract.numbers import check_array, numbers_in
from jaxpf.likelihoods.pixels import PixelLikelihood
from jaxpf.targets import building

if TYPE_CHECKING:
    from jaxpf.contract.types import LikelihoodLike
    from jaxpf.ordering import Ordering
    from jaxpf.targets.target import Start


def tracker(
    frame: ArrayLike | None,
    boxes: ArrayLike,
    *,
    like: str | None = None,
    method: str | None = None,
    num_particles: int | None = None,
    likelihood: "LikelihoodLike | str | None" = None,
    ordering: "Ordering | None" = None,
    patches: Sequence[np.ndarray] | None = None,
    **options: Any,
) -> Any:
    """Build the tracker of ``jaxpf track``, with its defaults unless options override them.

    By default, appearance is learned from the start frame and motion is relative to object size.

    Example::

        tracker = jaxpf.boxes.tracker(frames[0], [[120, 80, 40, 90]])
        _, summary = jaxpf.run(tracker, jax.random.key(0), frames[1:])
        jaxpf.boxes.to_boxes(tracker, summary.estimate)  # [T, P, 4]: x, y, w, h

    Args:
        frame: uint8 RGB ``[H, W, 3]`` that contains the boxes; tracking continues with the next
            frame.  It may be None with a user-defined likelihood.
        boxes: x, y, w, h in pixels, ``[P, 4]``.
        like: ``"smith2004"`` or ``"rowe2005"`` for that paper's system as printed; other arguments
            override it.  Options of rowe2005 are those of ``jaxpf.boxes.rowe2005_tracker``.
        method: ``"dps"`` (default), ``"sir"``, ``"ps"``, ``"sps"``, ``"labelled"``, ...
        num_particles: number of particles; default 300.
        likelihood: a user-defined likelihood of substates (u, v, a), the centre in pixels and the
            size relative to the start; or the name of a method to compute histograms.
        ordering: from ``jaxpf.ordering``, instead of a method.
        patches: P pictures, uint8 RGB ``[h, w, 3]``, from which colours are learned instead of
            from the frame.
        options: named and explained as the flags of ``jaxpf track``: ``appearance``, ``motion``,
            ``noise_relative``, ``sharpness``, ``noise_pixels``, ``resampling``, ...

    Returns:
        The tracker, for ``jaxpf.run``, ``jaxpf.stream`` and the others.

    Raises:
        InputError: an unknown option or a value out of range; the message names it.
    """
    if isinstance(like, str) and like == "rowe2005":
        if method is not None or likelihood is not None or ordering is not None:
            raise InputError(
                "like='rowe2005' has a method and likelihood of its own; leave those out."
            )
        if num_particles is not None:
            options["num_particles"] = num_particles
        return rowe2005_tracker(frame, _start(boxes).shapes, patches=patches, **options)
    if callable(network := options.get("network")):
        raise InputError(
            "network names a file; for a network of your own, give "
            "likelihood=jaxpf.likelihoods.pretrained(frame, boxes, network=...)."
        )
    if isinstance(network, os.PathLike):
        options["network"] = os.fspath(network)
    given = {"like": like, "method": method, "num_particles": num_particles, **options}
    own = {"likelihood": likelihood, "ordering": ordering, "patches": patches}
    return building.make(BOXES, frame, _start(boxes), given, **own)


def to_boxes(tracker: Any, estimate: ArrayLike) -> np.ndarray:
    """Convert estimates ``[..., P, D]`` to boxes x, y, w, h in pixels, ``[..., P, 4]``.

    Args:
        tracker: from ``tracker``.
        estimate: such as ``summary.estimate``.

    Raises:
        InputError: the tracker's dynamics do not know the sizes.
    """
    check_tracker(tracker)
    if isinstance(tracker.likelihood, PixelLikelihood):
        check_array("estimate", estimate, "u, v, w, h, [..., P, >= 4]")
        centre, sides = np.split(np.asarray(estimate)[..., :4], 2, axis=-1)
        return np.concatenate([centre - sides / 2, sides], axis=-1)
    sizes = getattr(tracker.dynamics, "sizes", None)
    if sizes is None:
        raise InputError(
            "this tracker's dynamics do not know the sizes of the boxes; make it with "
            "jaxpf.boxes.tracker, or use jaxpf.shapes.boxes_from_substates(estimate, sizes)."
        )
    check_array("estimate", estimate, f"u, v, a, [..., {len(sizes)}, >= 3]")
    return boxes_at(estimate, sizes)


def _start(boxes: ArrayLike) -> "Start":
    array = numbers_in("boxes", boxes, "x, y, w, h in pixels of every object, [>= 1, 4]")
    for number, box in enumerate(array):
        if not (np.isfinite(box).all() and (box[2:] > 0).all()):
            raise InputError(
                f"boxes[{number}] is {box.tolist()}: give x, y, and a positive width and height."
            )
    return BOXES.start(array)
