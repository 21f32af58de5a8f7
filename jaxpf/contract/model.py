"""The model that a target passes to a filter."""

import operator
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from jaxpf.contract.errors import InputError


class Model(NamedTuple):
    """Dynamics, likelihood and initial state of P partitions.

    Attributes:
        dynamics: see ``jaxpf.contract``.
        likelihood: see ``jaxpf.contract``.
        initial: ``[P, D]`` array, or a sampler ``key -> [P, D]`` registered as a pytree.  In an
            open population a row of NaN is an empty slot, and P is the maximum number of partitions
            at once.
        parents: the part tree, -1 for a root.
        initial_label: ``[L]``, initial probabilities of a particle's discrete label; None if
            particles carry no labels.
    """

    dynamics: Any
    likelihood: Any
    initial: Any
    parents: tuple[int, ...]
    initial_label: Any = None

    @property
    def num_partitions(self) -> int:
        """Number of partitions, P."""
        return len(self.parents)

    @property
    def is_open(self) -> bool:
        """Whether the population is open: partitions may appear and disappear."""
        return not callable(self.initial) and bool(np.isnan(self.initial).any())


def check_tree(
    parents: Sequence[int], names: Sequence[str] | None = None, what: str = ""
) -> tuple[int, ...]:
    """Return the part tree as a tuple of ints; refuse no part, an unknown parent, or a cycle.

    In messages ``names`` are those of the parts, and ``what`` is the tree.
    """
    tree = tuple(map(operator.index, parents))
    if not tree:
        raise InputError("parents is empty; give one entry per part, -1 for a root.")
    for part, parent in enumerate(tree):
        if not -1 <= parent < len(tree):
            raise InputError(
                f"parents[{part}]={parent} is not a part; use 0..{len(tree) - 1}, or -1 for a root."
            )
    for part in range(len(tree)):
        trail = [part]
        while tree[trail[-1]] != -1:
            trail.append(tree[trail[-1]])
            if trail[-1] in trail[:-1]:
                circle = trail[trail.index(trail[-1]) :]
                shown = [f"{step}" if names is None else f"'{names[step]}'" for step in circle]
                raise InputError(
                    f"{what or f'parents={list(tree)}'} form a cycle, {' on '.join(shown)}; "
                    "every part must lead to a root, which has no parent (-1)."
                )
    return tree
