"""Orderings as data: in which order partitions are processed, and when to resample."""

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
