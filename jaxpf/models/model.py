"""What a target hands to a filter."""

from typing import Any, NamedTuple


class Model(NamedTuple):
    """How substates move, how they explain a frame, and where they start.

    Attributes:
        dynamics: see ``jaxpf.contract``.
        likelihood: see ``jaxpf.contract``.
        initial: ``[P, D]`` array, or a sampler ``key -> [P, D]`` registered as a pytree.
        parents: the part tree, -1 for a root.
    """

    dynamics: Any
    likelihood: Any
    initial: Any
    parents: tuple[int, ...]

    @property
    def num_partitions(self) -> int:
        """P."""
        return len(self.parents)
