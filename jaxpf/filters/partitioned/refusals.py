"""Checks of a partitioned tracker at construction; strategies check themselves."""

from typing import Any

import numpy as np

from jaxpf import contract
from jaxpf.contract.calls import check_uncoupled
from jaxpf.contract.errors import InputError, choice
from jaxpf.contract.names import SWAPS
from jaxpf.contract.numbers import check_number, check_whole
from jaxpf.contract.pytree import is_concrete
from jaxpf.filters.partitioned.labels import check_labels
from jaxpf.gradients import check_gradients


def check_tracker(tracker: Any) -> None:
    """Refuse settings that cannot work or would be silently wrong."""
    check_whole("num_particles", tracker.num_particles)
    check_gradients(tracker)
    if tracker.tempering is not None:
        check_number("tempering", tracker.tempering, above=0, most=1)
    if tracker.ess_threshold is not None:
        check_number("ess_threshold", tracker.ess_threshold, least=0, most=1)
    ordering, parents = tracker.ordering, tracker.parents
    if len(parents) != ordering.num_partitions:
        raise InputError(
            f"parents has {len(parents)} parts but the ordering has {ordering.num_partitions}; "
            "give both the same number of partitions."
        )
    if not callable(tracker.initial):
        shape = np.shape(tracker.initial)
        if len(shape) != 2 or shape[0] != ordering.num_partitions:
            raise InputError(
                f"initial has shape {shape}; it must be [P, D] with P = {ordering.num_partitions} "
                "partitions, or a sampler key -> [P, D]."
            )
    if tracker.keep_ancestors and tracker.gradient.blends:
        raise InputError(
            "Transport blends particles, which then have no ancestors; leave keep_ancestors=True "
            "out, or use another gradient."
        )
    check_labels(tracker)
    tracker.motion.check(tracker)
    tracker.weighing.check(tracker)
    if not is_concrete(ordering) or np.ndim(ordering.order) != 2:
        return
    used = int(np.count_nonzero(np.asarray(ordering.fractions)))
    if tracker.num_particles < max(used, 1):
        raise InputError(
            f"num_particles={tracker.num_particles} is fewer than the {used} components of the "
            "ordering; use at least one particle per component."
        )
    for component, ranks in enumerate(np.asarray(ordering.rank)[:used]):
        for part, parent in enumerate(parents):
            if parent >= 0 and ranks[part] < ranks[parent]:
                raise InputError(
                    f"the order {np.asarray(ordering.order)[component].tolist()} puts part {part} "
                    f"before its parent {parent}; put every parent first."
                )
    if np.asarray(ordering.exchanged).any():
        check_exchange(tracker)


def check_exchange(tracker: Any) -> None:
    """Refuse an exchange that would be biased; the ordering must have one."""
    ordering = tracker.ordering
    swap = SWAPS[int(ordering.swap)]
    check_uncoupled(tracker.dynamics, choice("swap", swap))
    tree = tuple(np.asarray(ordering.tree).tolist())
    if contract.has_log_joint(tracker.likelihood):
        raise InputError(
            choice("swap", swap),
            f" needs a likelihood of single objects, and {type(tracker.likelihood).__name__} "
            "weighs them together by log_joint; use ",
            choice("swap", "none"),
            " or another ordering.",
        )
    if tracker.tempering is not None:
        raise InputError(
            choice("swap", swap),
            f" needs equal weights, and tempering={tracker.tempering} leaves them unequal; use "
            "tempering=None or ",
            choice("swap", "none"),
            ".",
        )
    if tree != tracker.parents:
        raise InputError(
            f"the ordering's part tree {list(tree)} is unlike the model's {list(tracker.parents)}; "
            "with ",
            choice("swap", swap),
            " both must be the same.",
        )
    # NumPy, because JAX would compile each of these operations.
    is_root = np.asarray(ordering.tree)[np.asarray(ordering.order)[0]] < 0
    roots_exchanged = bool((np.asarray(ordering.exchanged) & is_root).any())
    independent = not callable(tracker.initial) or contract.draws_independently(tracker.initial)
    if roots_exchanged and not independent:
        raise InputError(
            choice("swap", swap),
            " exchanges roots, but the initial sampler may draw them jointly; use a sampler with "
            "the attribute independent=True, or sps(..., exchange_roots=False).",
        )
