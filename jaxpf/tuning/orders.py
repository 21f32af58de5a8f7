"""Choose the order of partitioned sampling by pilot runs.

Stage-by-stage errors of one order do not reveal the best order, since another order has other
stages.  Instead, candidate orders are run on the first frames and compared by the variance of the
estimates over independent runs.
"""

import dataclasses
from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import numpy as np

from jaxpf.contract.errors import InputError
from jaxpf.ordering import named, ps
from jaxpf.running.blocks import monte_carlo
from jaxpf.tuning.objectives import keep_moments

#: Default maximum number of candidates.
CANDIDATES = 12


class Pilot(NamedTuple):
    """Results of pilot runs of K orders, best first.

    Attributes:
        orders: permutations of the partitions, from 0.
        variance: ``[K]``, variance of the estimates over runs, relative to the posterior variance;
            its inverse is a number of independent particles.  The best order's variance is measured
            again with fresh keys, since the minimum of several estimates is biased downwards.
        standard_error: ``[K]``, standard error of ``variance`` over runs.
    """

    orders: list[tuple[int, ...]]
    variance: np.ndarray
    standard_error: np.ndarray


def best_order(
    tracker: Any,
    key: jax.Array,
    frames: Any,
    orders: Sequence[Sequence[int]] | None = None,
    num_runs: int = 16,
) -> Pilot:
    """Compare orders of partitioned sampling by the Monte-Carlo variance of pilot runs.

    Use a different key than for tracking: the choice is then independent of the tracker's random
    numbers, and its evidence stays unbiased.  All orders share the pilot keys and one compiled
    kernel.

    Args:
        tracker: a ``jaxpf.Partitioned`` with any ordering.
        key: random key of the pilot runs.
        frames: ``[T, ...]``, the first frames of the sequence.
        orders: candidates; by default ``candidate_orders``.
        num_runs: R, pilot runs per order.

    Returns:
        The orders, best first.

    Raises:
        InputError: the tracker has no order to choose (it is of another kind, branched, or has one
            partition), there are fewer than two runs, or an order puts a child before its parent.
    """
    ordering = getattr(tracker, "ordering", None)
    if ordering is None or ordering.keeps_components or ordering.num_partitions < 2:
        raise InputError(
            "an order is chosen for partitioned sampling of several objects in one order; use "
            "method ps on at least two, without labels that each bring an order."
        )
    if num_runs < 2:
        raise InputError(f"num_runs={num_runs} says nothing of how runs differ; give at least 2.")
    keys = jax.random.split(key, num_runs)
    orders = candidate_orders(tracker.parents) if orders is None else orders

    def moments(order: Sequence[int], keys: jax.Array) -> tuple[np.ndarray, np.ndarray]:
        ordered = dataclasses.replace(tracker, ordering=ps(order))
        kept = monte_carlo(ordered, keys, frames, keep_moments, batch_size=num_runs)
        return np.asarray(kept[0], np.float64), np.asarray(kept[1], np.float64)

    estimates, variances = [], []
    for order in orders:
        estimate, spread = moments(order, keys)
        estimates.append(estimate)
        variances.append(np.mean(spread**2, axis=(0, 1, 2)))
    # Pixels and degrees cannot be added: scale each coordinate by its posterior variance.  All
    # orders share this scale, or orders with a wide cloud would be preferred.
    posterior = np.mean(variances, axis=0)
    scores = np.array([_relative_variance(estimate, posterior) for estimate in estimates])
    by_variance = np.argsort(scores[:, 0], kind="stable")
    ranked, scores = [tuple(orders[place]) for place in by_variance], scores[by_variance]
    if len(ranked) > 1:
        fresh_keys = jax.random.split(jax.random.fold_in(key, 1), num_runs)
        scores[0] = _relative_variance(moments(ranked[0], fresh_keys)[0], posterior)
    return Pilot(ranked, *scores.T)


def _relative_variance(estimate: np.ndarray, posterior: np.ndarray) -> tuple[float, float]:
    """Variance of estimates ``[R, T, P, D]`` over runs in units of ``[D]``; its standard error."""
    num_runs, varies = len(estimate), posterior > 0
    squares = (estimate - estimate.mean(axis=0)) ** 2 * num_runs / (num_runs - 1)
    of_runs = squares.mean(axis=(1, 2))[:, varies] / posterior[varies]
    of_runs = of_runs.mean(axis=1) if varies.any() else np.zeros(num_runs)
    return of_runs.mean(), of_runs.std(ddof=1) / num_runs**0.5


def candidate_orders(parents: Sequence[int], most: int = CANDIDATES) -> list[tuple[int, ...]]:
    """Orders worth trying: the circular shifts, then random permutations from a fixed seed.

    Args:
        parents: the part tree.  If parts have parents, the level-by-level order replaces the
            shifts, and every order puts parents first.
        most: maximum number of orders.
    """
    count, base = len(parents), tuple(range(len(parents)))
    if any(parent >= 0 for parent in parents):
        found = [tuple(int(part) for part in named("ps", tuple(parents)).order[0])]
    else:
        found = [base[shift:] + base[:shift] for shift in range(count)]
    rng = np.random.default_rng(0)
    # Few partitions have few orders: stop when the tries find no new one.
    for _ in range(20 * most):
        if len(found) >= most:
            break
        order: list[int] = []
        while len(order) < count:
            open_parts = [p for p in base if p not in order and parents[p] in (-1, *order)]
            order.append(int(rng.choice(open_parts)))
        if tuple(order) not in found:
            found.append(tuple(order))
    return found[:most]
