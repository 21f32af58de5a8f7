"""Depth as an order: who of several opaque targets is nearer the camera.

A label is the place, in the list of all permutations, of the order in which the targets lie behind
one another, the nearest first.  Of two targets the label is 0 where the first is nearer, else 1.
"""

from functools import cache
from itertools import permutations
from math import factorial

import numpy as np
from numpy.typing import ArrayLike

from jaxpf.contract.errors import InputError

#: There are 24 orders of four targets, among which particles divide, and 120 of five.
MOST_OPAQUE = 4


@cache
def depth_orders(num_targets: int) -> tuple[tuple[int, ...], ...]:
    """For each label the targets ``[P]``, the nearest first: all permutations, P! of them.

    Raises:
        InputError: fewer than two targets, or more than ``MOST_OPAQUE``.
    """
    if not 2 <= num_targets <= MOST_OPAQUE:
        raise InputError(
            f"{num_targets} opaque target(s): particles divide among all orders in which targets "
            f"lie behind one another, 24 of four and 120 of five; give 2 to {MOST_OPAQUE} closed "
            "contours, or treat the targets as wires."
        )
    return tuple(permutations(range(num_targets)))


def depths(num_targets: int) -> np.ndarray:
    """``[L, P]``: for each label, how many targets are nearer than each."""
    return np.argsort(depth_orders(num_targets), axis=1)


def neighbours_exchanged(num_targets: int) -> np.ndarray:
    """``[L, P - 1]``: the label if the targets at places k and k + 1 of the order change places."""
    orders = depth_orders(num_targets)
    return np.array(
        [
            [
                orders.index((*order[:k], order[k + 1], order[k], *order[k + 2 :]))
                for k in range(num_targets - 1)
            ]
            for order in orders
        ]
    )


def in_front(label_probabilities: ArrayLike) -> np.ndarray:
    """Probability ``[..., P, P]`` that target i is nearer the camera than j, at ``[..., i, j]``.

    Args:
        label_probabilities: ``[..., P!]``, as the summaries of a tracker of opaque targets hold.

    Raises:
        InputError: not as many labels as two to four targets have orders.
    """
    probabilities = np.asarray(label_probabilities)
    counts = {factorial(count): count for count in range(2, MOST_OPAQUE + 1)}
    labels = probabilities.shape[-1] if probabilities.ndim else 0
    if labels not in counts:
        raise InputError(
            f"label_probabilities has shape {probabilities.shape}; its last axis holds one "
            f"probability for each order of the targets in depth: {list(counts)} for "
            f"{list(counts.values())} targets."
        )
    depth = depths(counts[labels])
    nearer = depth[:, :, None] < depth[:, None, :]
    return np.tensordot(probabilities, nearer.astype(probabilities.dtype), 1)
