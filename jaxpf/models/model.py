"""What a target hands to a filter."""

from typing import Any, NamedTuple

import numpy as np


class Model(NamedTuple):
    """How substates move, how they explain a frame, and where they start.

    Attributes:
        dynamics: see ``jaxpf.contract``.
        likelihood: see ``jaxpf.contract``.
        initial: ``[P, D]`` array, or a sampler ``key -> [P, D]`` registered as a pytree.  A row of
            NaN is an empty place: partitions come and go, and P is how many there can be at once.
        parents: the part tree, -1 for a root.
        initial_label: ``[L]``, probabilities of a particle's discrete label at the start, for
            filters whose particles carry one; None: there is none.
    """

    dynamics: Any
    likelihood: Any
    initial: Any
    parents: tuple[int, ...]
    initial_label: Any = None

    @property
    def num_partitions(self) -> int:
        """P."""
        return len(self.parents)

    @property
    def is_open(self) -> bool:
        """Whether partitions come and go."""
        return not callable(self.initial) and bool(np.isnan(self.initial).any())
