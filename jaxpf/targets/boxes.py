"""Trackers of coloured boxes: what the command line, the experiments and notebooks use.

A box is a partition with substate (u, v, a): centre in pixels and scale relative to the
size it started with (smith2004, section 2).
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from jaxpf.errors import InputError
from jaxpf.filters.partitioned import ordering as orderings
from jaxpf.filters.partitioned.ordering import Ordering
from jaxpf.filters.partitioned.tracker import Partitioned
from jaxpf.models.dynamics import AR2

METHODS = ("sir", "ps", "dps", "sps")

#: Noise of centre (pixels) and scale per frame: wide enough for people walking in video.
DEFAULT_SCALE = (4.0, 2.0, 0.003)


def ordering_of(
    method: str,
    num_partitions: int,
    *,
    order: Sequence[int] | None = None,
    swap: str = "combinatorial",
    reassembly: str = "evidence",
) -> Ordering:
    """The ordering that a method's name stands for.

    Args:
        method: one of ``METHODS``.
        num_partitions: P.
        order: permutation of 0..P-1 for ``ps``; default 0, 1, ..., P-1.
        swap: for ``sps``.
        reassembly: for ``dps``.

    Raises:
        InputError: unknown method, or an order given to a method that has none.
    """
    if method not in METHODS:
        raise InputError(f"method {method!r} is unknown; choose one of {', '.join(METHODS)}.")
    if order is not None and method != "ps":
        raise InputError(f"an order was given, but method {method!r} has none; use method 'ps'.")
    if order is not None and len(order) != num_partitions:
        raise InputError(
            f"order {list(order)} has {len(order)} entries for {num_partitions} objects; name "
            "every object once."
        )
    if method == "sir":
        return orderings.sir(num_partitions)
    if method == "ps":
        return orderings.ps(list(range(num_partitions)) if order is None else order)
    if method == "dps":
        return orderings.dps(num_partitions, reassembly=reassembly)
    return orderings.sps(num_partitions=num_partitions, swap=swap)


def box_tracker(
    likelihood: Any,
    boxes: ArrayLike,
    ordering: Ordering,
    *,
    scale: ArrayLike = DEFAULT_SCALE,
    num_particles: int = 300,
    resampling: str = "systematic",
    ess_threshold: float | None = None,
) -> Partitioned:
    """A tracker that starts at given boxes and moves them by smith2004's AR2 dynamics.

    Args:
        likelihood: of substates (u, v, a), such as ``jaxpf.likelihoods.histogram(...)``.
        boxes: x, y, w, h in pixels, ``[P, 4]``: where the objects are before the first frame.
        ordering: from ``ordering_of`` or ``jaxpf.ordering``.
        scale: noise of u, v (pixels) and a per frame, ``[3]`` or ``[P, 3]``.
        num_particles: N.
        resampling: a scheme of ``jaxpf.resampling.SCHEMES``.
        ess_threshold: see ``Partitioned``.

    Raises:
        InputError: noise that is negative or not finite; and see ``check_tracker``.
    """
    boxes = np.asarray(boxes, np.float32).reshape(-1, 4)
    scale = np.asarray(scale, np.float32)
    if scale.shape[-1:] != (3,) or not np.all(np.isfinite(scale)) or np.any(scale < 0):
        raise InputError(
            f"scale {scale.tolist()} must be three finite numbers >= 0: the noise of x and y in "
            "pixels and of the relative size, such as 4,2,0.003."
        )
    centres = boxes[:, :2] + boxes[:, 2:] / 2
    return Partitioned(
        dynamics=AR2(scale=scale),
        likelihood=likelihood,
        ordering=ordering,
        initial=np.concatenate([centres, np.ones((len(boxes), 1), np.float32)], axis=1),
        num_particles=num_particles,
        resampling=resampling,
        ess_threshold=ess_threshold,
    )
