"""Depth order of opaque targets.

A label is the index, in the list of all permutations, of the order of the targets in depth,
nearest first.  For two targets the label is 0 if the first is nearer, otherwise 1.
"""

from functools import cache
from itertools import permutations
from math import factorial

import numpy as np
from numpy.typing import ArrayLike

from jaxpf.contract.errors import InputError

#: Particles are divided among the orders: 24 for four targets, 120 for five.
MOST_OPAQUE = 4


@cache
def depth_orders(num_targets: int) -> tuple[tuple[int, ...], ...]:
    """The targets ``[P]`` of each label, nearest first: all P! permutations.

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
    """Depth of each target for each label, ``[L, P]``: the number of nearer targets."""
    return np.argsort(depth_orders(num_targets), axis=1)


def neighbours_exchanged(num_targets: int) -> np.ndarray:
    """New label ``[L, P - 1]`` after exchanging the targets at places k and k + 1 of the order."""
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
        label_probabilities: ``[..., P!]``, from the summaries of a tracker of opaque targets.
    """
    probabilities = np.asarray(label_probabilities)
    counts = {factorial(count): count for count in range(2, MOST_OPAQUE + 1)}
    depth = depths(counts[probabilities.shape[-1]])
    nearer = depth[:, :, None] < depth[:, None, :]
    return np.tensordot(probabilities, nearer.astype(probabilities.dtype), 1)
