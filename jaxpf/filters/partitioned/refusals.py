"""Checks of a partitioned tracker at construction; strategies check themselves."""

from collections.abc import Iterator
from typing import Any

import jax
import numpy as np

from jaxpf.contract import calls
from jaxpf.contract.calls import coupled_with
from jaxpf.contract.errors import Argument, InputError, check_separate, choice
from jaxpf.contract.optional import optional
from jaxpf.contract.options import check_fields
from jaxpf.contract.pytree import is_concrete
from jaxpf.contract.refusals import refused
from jaxpf.filters.initial import check_rows
from jaxpf.filters.partitioned.labels import check_labels, moves_labels
from jaxpf.filters.partitioned.motion import motion_of
from jaxpf.filters.partitioned.settings import Settings
from jaxpf.filters.partitioned.weighing import weighing_of
from jaxpf.gradients import check_gradients


def check_tracker(tracker: Settings) -> jax.Array | None:
    """Refuse settings that cannot work or would be silently wrong.

    Returns:
        Bool, whether traced values make one to refuse; None if they are known.
    """
    check_fields(tracker)
    check_gradients(tracker)
    ordering, parents = tracker.ordering, tracker.parents
    if len(parents) != ordering.num_partitions:
        raise InputError(
            f"parents has {len(parents)} parts but the ordering has {ordering.num_partitions}; "
            "give both the same number of partitions."
        )
    blends = tracker.keep_ancestors and tracker.gradient.blends
    check_separate("keep_ancestors=True", (blends, "gradient Transport, which blends particles"))
    check_rows(tracker.dynamics, ordering.num_partitions)
    check_labels(tracker)
    motion = motion_of(tracker)
    motion.check(tracker)
    weighing_of(tracker).check(tracker)
    return refused(*_of_ordering(tracker), *_of_exchange(tracker), *motion.cases(tracker))


def _of_ordering(tracker: Settings) -> Iterator[tuple[Any, tuple[str | Argument, ...]]]:
    """Cases in which the ordering's components do not fit the rest, for ``refused``."""
    ordering = tracker.ordering.known
    used = (ordering.fractions > 0).sum(-1)
    yield (
        used > tracker.num_particles,
        (
            f"num_particles={tracker.num_particles} is fewer than the {_largest(used)} components "
            "of the ordering; use at least one particle per component.",
        ),
    )
    for part, parent in enumerate(tracker.parents):
        if parent < 0:
            continue
        before = ordering.rank[..., part] < ordering.rank[..., parent]  # [C]; padding repeats one
        order = ordering.order[before][0].tolist() if is_concrete(before) and before.any() else ""
        yield (
            before.any(-1),
            (
                f"the order {order} puts part {part} before its parent {parent}; put every parent "
                "first.",
            ),
        )
    if tracker.initial_label is not None and ordering.keeps_components:
        num_labels = np.shape(tracker.initial_label)[0]
        yield (
            used < num_labels,
            (
                f"initial_label has {num_labels} labels, but the ordering has {_largest(used)} "
                "branches; give it an order for each label.",
            ),
        )


def _of_exchange(tracker: Settings) -> Iterator[tuple[Any, tuple[Any, ...]]]:
    """Cases in which an exchange does not work or would be biased, for ``refused``."""
    ordering, likelihood = tracker.ordering.known, type(tracker.likelihood).__name__
    swap, none = ordering.swap_shown, choice("swap", "none")
    tree, parents = ordering.tree, np.array(tracker.parents, np.int32)
    for applies, reason in (
        (tracker.gradient.blends, "needs lineages, and gradient Transport blends particles"),
        (
            calls.has_log_joint(tracker.likelihood),
            f"needs a likelihood of single objects, and {likelihood} has log_joint",
        ),
        (
            tracker.tempering is not None,
            f"needs equal weights, and tempering={tracker.tempering} leaves them unequal",
        ),
        (
            moves_labels(tracker),
            "separates a particle's parts, on which its label depends by propagate_label",
        ),
    ):
        if applies:
            yield ordering.exchanges, (swap, f" {reason}; use ", none, " or another ordering.")
    if calls.is_coupled(calls.first_motion(tracker.dynamics)):
        yield (
            ordering.exchanges & ~ordering.forgets_coupling,
            (*coupled_with(tracker.dynamics, swap), " Or use ordering.blocks, which is biased."),
        )
    yield (
        ordering.exchanges & (tree != parents).any(-1),
        (
            f"the ordering's part tree {tree.tolist() if is_concrete(tree) else ''} is unlike the "
            f"model's {parents.tolist()}; with ",
            swap,
            " both must be the same.",
        ),
    )
    if callable(tracker.initial) and not optional(tracker.initial, "independent"):
        yield (
            ordering.exchanges_roots,
            (
                swap,
                " exchanges roots, but the initial sampler may draw them jointly; use a sampler "
                "with the attribute independent=True, or sps(..., exchange_roots=False).",
            ),
        )


def _largest(counts: jax.Array) -> Any:
    return counts.max() if is_concrete(counts) else ""
