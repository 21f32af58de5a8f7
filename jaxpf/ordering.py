"""In which order partitions are treated, and who is resampled when: an ordering is data."""

from jaxpf.filters.partitioned.ordering import (
    SWAPS,
    Ordering,
    branched,
    dps,
    named,
    ps,
    sir,
    sps,
    tree_levels,
)
from jaxpf.models.model import check_tree

__all__ = [
    "SWAPS",
    "Ordering",
    "branched",
    "check_tree",
    "dps",
    "named",
    "ps",
    "sir",
    "sps",
    "tree_levels",
]
