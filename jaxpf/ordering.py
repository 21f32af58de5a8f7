"""Orderings as data: SIR, PS, DPS, SPS and branched partitioned sampling.

A frame of partitioned sampling is P stages of the same operation, and the methods differ
only in small integer arrays: which partition a particle's component processes at each
stage, after which stages to resample, and which parts may be exchanged.  All of them are
traced, so one compiled kernel serves every ordering of the same number of partitions.

The tables always have room for C = P components; what a method does not use is empty.
"""

import operator
from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxpf.contract.errors import InputError, check_known
from jaxpf.contract.model import check_tree
from jaxpf.contract.names import METHODS, REASSEMBLIES, SWAPS
from jaxpf.contract.pytree import as_array, pytree_dataclass, static_field


@pytree_dataclass
class Ordering:
    """In which order, and in which groups, a frame's partitions are processed.

    Build one with ``sir``, ``ps``, ``dps``, ``sps`` or ``branched``.

    Attributes:
        order: ``[C, P]`` int32, the partition that component c processes at stage j.
        rank: ``[C, P]`` int32, its inverse: the stage at which c processes partition p.
        fractions: ``[C]``, share of the particles that a random split gives component c.
        resample_after: ``[P]`` bool, resample (within components) after stage j.
        exchange_after: ``[P]`` bool, stage j ends a level whose parts are exchanged, or which
            a later level of exchanged parts hangs from.
        exchanged: ``[P]`` bool, stage j belongs to a level whose parts are exchanged.
        level: ``[P]`` int32, the level of stage j in the part tree.
        carrier: ``[P, P]`` int32, ``carrier[j, r]`` is the stage, in the level of stage j,
            of the part that stage r's part is or hangs from; -1 if it is carried by none.
        swap: ``[]`` int32, index into ``SWAPS``.
        literal: ``[]`` bool, smith2004's literal reassembly.
        tree: ``[P]`` int32, parents of the part tree of ``sps``; -1 for a root.
        keeps_components: static, particles keep their component from frame to frame (branched);
            else they are split anew.
    """

    order: jax.Array
    rank: jax.Array
    fractions: jax.Array
    resample_after: jax.Array
    exchange_after: jax.Array
    exchanged: jax.Array
    level: jax.Array
    carrier: jax.Array
    swap: jax.Array
    literal: jax.Array
    tree: jax.Array
    keeps_components: bool = static_field(default=False)

    @property
    def num_partitions(self) -> int:
        """Number of partitions, P."""
        return self.order.shape[-1]

    @property
    def is_split(self) -> jax.Array:
        """``[]`` bool: particles divide into components, or may do so; the same for all runs."""
        return jnp.asarray(self.keeps_components) | (self.fractions[0] < 1.0)


def sir(num_partitions: int) -> Ordering:
    """Condensation: no resampling inside the frame ("Non-PS" in smith2004)."""
    _check_count(num_partitions)
    return _ordering([range(num_partitions)], np.zeros(num_partitions, bool))


def ps(order: Sequence[int]) -> Ordering:
    """Partitioned sampling in one order, resampling after every stage but the last.

    Source: maccormick1999, section 5; smith2004, figure 1.
    """
    return _ordering([order], _all_but_last(len(_entries(order))))


def dps(
    num_partitions: int | None = None,
    orders: Sequence[Sequence[int]] | None = None,
    reassembly: str = "evidence",
) -> Ordering:
    """Distributed partitioned sampling: PS in another order in each component.

    The particles are split at random, without replacement, into components whose sizes
    differ by at most one.  Source: smith2004, section 4 and figure 5.

    Args:
        num_partitions: P; the orders are then the P circular shifts of 0..P-1.
        orders: instead, one permutation per component.  On a part tree, none may put a
            child before its parent.
        reassembly: ``"evidence"`` weighs each component by its prior mass times its
            evidence, which keeps the set properly weighted; ``"literal"`` renormalises
            each component to its prior mass, as the paper does.  The literal rule drops
            the components' evidence and biases the estimates at finite N (measured at
            N = 300: mean bias .083 against .021 on the hardest part).
    """
    if orders is None:
        if num_partitions is None:
            raise InputError("dps() needs a number of partitions or a list of orders.")
        _check_count(num_partitions)
        base = list(range(num_partitions))
        orders = [base[shift:] + base[:shift] for shift in range(num_partitions)]
    elif num_partitions is not None and any(len(order) != num_partitions for order in orders):
        raise InputError(
            f"orders={list(map(list, orders))} do not all hold the {num_partitions} partitions; "
            "give each component a permutation of all of them."
        )
    check_known("reassembly=", reassembly, REASSEMBLIES)
    if not orders:
        raise InputError("orders is empty; give at least one permutation of the partitions.")
    return _ordering(orders, _all_but_last(len(orders[0])), literal=reassembly == "literal")


def branched(orders: Sequence[Sequence[int]]) -> Ordering:
    """Branched partitioned sampling: the component of a particle is its discrete label.

    Particles follow ``orders[label]`` (``Partitioned.initial_label``), or without labels
    ``orders[state.component]``, which they keep through resampling;
    branches have run-time sizes and may be empty (maccormick1999, figure 8).
    """
    if not orders:
        raise InputError("orders is empty; give at least one permutation of the partitions.")
    return _ordering(orders, _all_but_last(len(orders[0])), keeps_components=True)


def sps(
    parents: Sequence[int] | None = None,
    swap: str = "combinatorial",
    *,
    num_partitions: int | None = None,
    exchange_roots: bool = True,
) -> Ordering:
    """Simultaneous partitioned sampling: level by level down the part tree.

    The parts of one level are propagated and weighed together, parts of particles that
    share their parent's draw are exchanged, then the set is resampled once, but not after the
    last level.  Source: gonzales2011, figures 3 to 6.

    Exchange is right only where a part's motion and likelihood depend on nothing but its own past
    and its parent, as ``jaxpf.contract.Dynamics`` requires.  If one object follows another by
    other means, exchange is silently wrong: use ``swap="none"``, or make it a child in the tree.

    Args:
        parents: the part tree, ``parents[p]`` the parent of part p and -1 for a root.
        swap: ``"combinatorial"`` resamples from the implicit set of all pairings
            (Dubuisson, Gonzales & Nguyen 2012): unbiased.  ``"sorted"`` pairs best with
            best, as gonzales2011 does; that biases the evidence, whatever N, by an amount that
            depends on the model:
            E[Z^]/Z = 52 and a posterior variance of .59 of the exact one on a linear-Gaussian
            tree of three parts (a = .9, coupling .5, process noise 1, observation noise .3,
            T = 5, N = 30), 1.72 on the model of the notebook ``swap_bias``.
            ``"random"`` pairs at random; ``"none"`` leaves particles whole.
        num_partitions: instead of ``parents``, that many independent objects (all roots).
        exchange_roots: with several roots, exchange them too.  Exact for objects without
            parts; for roots with parts of their own it costs O(1/N), and ``False`` is exact.
    """
    if parents is None:
        if num_partitions is None:
            raise InputError("sps() needs the part tree `parents` or a number of partitions.")
        _check_count(num_partitions)
        parents = [-1] * num_partitions
    check_known("swap=", swap, SWAPS)
    tree = check_tree(parents)
    depth = tree_levels(tree)
    order = sorted(range(len(tree)), key=lambda part: (depth[part], part))
    level = np.array([depth[part] for part in order])
    level_end = np.append(level[1:] != level[:-1], True)
    level_sizes = np.bincount(level)
    may_exchange = level_sizes > 1
    if not exchange_roots:
        may_exchange[0] = False
    exchanged = may_exchange[level] if swap != "none" else np.zeros(len(tree), bool)
    resample_after = level_end.copy()
    resample_after[-1] = False
    return _ordering(
        [order],
        resample_after,
        level=level,
        exchanged=exchanged,
        # A level without exchange also records shared draws where a later level needs them.
        exchange_after=level_end & np.maximum.accumulate(exchanged[::-1])[::-1],
        swap=SWAPS.index(swap),
        tree=tree,
    )


def named(
    method: str,
    parents: Sequence[int],
    *,
    order: Sequence[int] | None = None,
    swap: str = "combinatorial",
    reassembly: str = "evidence",
) -> Ordering:
    """The ordering that a method's name stands for.

    Args:
        method: "sir", "ps", "dps" or "sps".
        parents: the part tree, -1 for a root; all of them for independent objects.
        order: for "ps", all partitions, each after its parent; by default level by level, which
            for objects is 0, 1, ..., P-1.
        swap: for "sps"; roots are exchanged only if no part hangs on them.
        reassembly: for "dps".
    """
    tree = check_tree(parents)
    check_known("method ", method, METHODS)
    if order is not None and method != "ps":
        raise InputError(f"an order was given, but method {method!r} has none; use method 'ps'.")
    if order is not None and len(order) != len(tree):
        raise InputError(
            f"order {list(order)} has {len(order)} entries for {len(tree)} objects; name every "
            "object once."
        )
    if method == "sps":
        # Exact: roots that carry parts keep their pasts.
        return sps(tree, swap, exchange_roots=all(parent < 0 for parent in tree))
    if method == "dps":
        if any(parent >= 0 for parent in tree):
            raise InputError(
                "method 'dps' goes through circular shifts, which put parts before their parents; "
                "choose one of sir, ps, sps, or give orders of your own to ordering.dps."
            )
        return dps(len(tree), reassembly=reassembly)
    depth = tree_levels(tree)
    downwards = sorted(range(len(tree)), key=lambda part: (depth[part], part))
    if method == "sir":
        # Parents first, without resampling in between.
        return _ordering([downwards], np.zeros(len(tree), bool))
    return ps(downwards if order is None else order)


def tree_levels(tree: Sequence[int]) -> list[int]:
    """Depth of each part below its root."""

    def depth(part: int) -> int:
        return 0 if tree[part] == -1 else 1 + depth(tree[part])

    return [depth(part) for part in range(len(tree))]


def _all_but_last(num_partitions: int) -> np.ndarray:
    return np.arange(num_partitions) < num_partitions - 1


def _check_count(num_partitions: int) -> None:
    if isinstance(num_partitions, bool) or not isinstance(num_partitions, int | np.integer):
        raise InputError(f"num_partitions={num_partitions!r} must be a whole number.")
    if num_partitions < 1:
        raise InputError(f"num_partitions={num_partitions} must be at least 1.")


def _check_permutation(order: Sequence[int], num_partitions: int, component: int) -> list[int]:
    entries = _entries(order)
    if sorted(entries) != list(range(num_partitions)) or not entries:
        raise InputError(
            f"order {entries} of component {component} is not a permutation of "
            f"0..{max(num_partitions - 1, 0)}; name every partition exactly once."
        )
    return entries


def _entries(order: Any) -> list[int]:
    """An order's whole numbers; a text of digits is refused."""
    try:
        if isinstance(order, str | bytes):
            raise TypeError
        return [operator.index(partition) for partition in order]
    except TypeError:
        raise InputError(
            f"order {order!r} is not a list of whole numbers; give the partitions, counted from 0, "
            "such as [2, 0, 1]."
        ) from None


def _ordering(
    orders: Sequence[Sequence[int]],
    resample_after: np.ndarray,
    *,
    level: np.ndarray | None = None,
    exchanged: np.ndarray | None = None,
    exchange_after: np.ndarray | None = None,
    swap: int = 0,
    literal: bool = False,
    tree: Sequence[int] | None = None,
    keeps_components: bool = False,
) -> Ordering:
    """Fill the tables, padded to at least P components."""
    num_partitions = len(_entries(orders[0]))
    table = np.array(
        [_check_permutation(order, num_partitions, c) for c, order in enumerate(orders)], np.int32
    )
    used = len(table)
    room = max(used, num_partitions)
    order_table = np.concatenate([table, np.repeat(table[:1], room - used, axis=0)])
    fractions = np.where(np.arange(room) < used, 1.0 / used, 0.0)
    tree = (-1,) * num_partitions if tree is None else tuple(tree)
    level = np.arange(num_partitions) if level is None else level
    never = np.zeros(num_partitions, bool)
    return Ordering(
        order=as_array(order_table),
        rank=as_array(np.argsort(order_table, axis=1), np.int32),
        fractions=as_array(fractions, np.float32),
        resample_after=as_array(resample_after),
        exchange_after=as_array(never if exchange_after is None else exchange_after),
        exchanged=as_array(never if exchanged is None else exchanged),
        level=as_array(level, np.int32),
        carrier=as_array(carriers(order_table[0], level, tree)),
        swap=as_array(swap, np.int32),
        literal=as_array(literal, bool),
        tree=as_array(tree, np.int32),
        keeps_components=keeps_components,
    )


def carriers(order: np.ndarray, level: np.ndarray, tree: Sequence[int]) -> np.ndarray:
    """``[P, P]``: at stage j's level, the stage of the part that carries stage r's part."""
    num_partitions = len(order)
    stage_of = {int(part): stage for stage, part in enumerate(order)}
    carrier = np.full((num_partitions, num_partitions), -1, np.int32)
    for row, part in enumerate(order):
        ancestor = int(part)
        while ancestor != -1:
            same_level = level == level[stage_of[ancestor]]
            carrier[same_level, row] = stage_of[ancestor]
            ancestor = tree[ancestor]
    return carrier
