"""Orderings as data: SIR, PS, DPS, SPS, branched partitioned sampling, and blocks.

A frame of partitioned sampling consists of P stages of the same operation.  The methods differ
only in small arrays: which partition a component processes at each stage, after which stages to
resample, and which parts to exchange.  These arrays are traced, so one compiled kernel serves
every ordering of the same number of partitions.

The tables are padded to at least C = P components; unused components are empty.
"""

import dataclasses
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np

from jaxpf.contract.errors import Argument, InputError, check_known, choice
from jaxpf.contract.model import check_tree
from jaxpf.contract.numbers import check_whole
from jaxpf.contract.pytree import as_array, is_concrete, pytree_dataclass, static_field

#: Named orderings, see ``named``.
METHODS = ("sir", "ps", "dps", "sps")
#: Exchange rules of simultaneous partitioned sampling, in the order of their codes.
SWAPS = ("none", "random", "sorted", "combinatorial")
#: Rules that reassemble the components of DPS at the end of a frame.
REASSEMBLIES = ("evidence", "literal")

#: Largest number of partitions: the tables of an ordering hold its square.
_MOST_PARTITIONS = 10_000


@pytree_dataclass
class Ordering:
    """The order in which, and the components by which, a frame's partitions are processed.

    Build one with ``sir``, ``ps``, ``dps``, ``sps``, ``blocks`` or ``branched``.

    Attributes:
        order: ``[C, P]`` int32, the partition that component c processes at stage j.
        rank: ``[C, P]`` int32, inverse of ``order``: the stage at which c processes partition p.
        fractions: ``[C]``, share of the particles that component c gets in a random split.
        resample_after: ``[P]`` bool, whether to resample within components after stage j.
        exchange_after: ``[P]`` bool, whether stage j ends a level that exchanges parts, or a level
            above one that does.
        exchanged: ``[P]`` bool, whether stage j belongs to a level that exchanges parts.
        level: ``[P]`` int32, the level of stage j in the part tree.
        carrier: ``[P, P]`` int32, ``carrier[j, r]`` is the stage, in the level of stage j, of the
            part that is stage r's part or its ancestor in the part tree; -1 if there is none.
        swap: ``[]`` int32, index into ``SWAPS``.
        literal: ``[]`` bool, whether to use smith2004's literal reassembly.
        tree: ``[P]`` int32, parents of the part tree of ``sps``; -1 for a root.
        forgets_coupling: ``[]`` bool, whether coupled dynamics are allowed with an exchange, which
            is then biased (``blocks``).
        keeps_components: static, whether particles keep their component from frame to frame
            (branched) instead of being split again in every frame.
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
    forgets_coupling: jax.Array
    keeps_components: bool = static_field(default=False)

    @property
    def num_partitions(self) -> int:
        """Number of partitions, P."""
        return self.order.shape[-1]

    @property
    def known(self) -> "Ordering":
        """The same with NumPy arrays, unless it is traced.

        Within a user's trace, JAX operations on known arrays would return tracers.
        """
        return jax.tree.map(np.asarray, self) if is_concrete(self) else self

    @property
    def exchanges(self) -> jax.Array:
        """``[]`` bool: whether parts are exchanged."""
        return self.known.exchanged.any(-1)

    @property
    def exchanges_roots(self) -> jax.Array:
        """``[]`` bool: whether roots, the first level, are exchanged."""
        return (self.known.exchanged & (self.known.level == 0)).any(-1)

    @property
    def exchanges_best(self) -> jax.Array:
        """``[]`` bool: whether best is paired with best, which biases the evidence."""
        return self.exchanges & (self.known.swap == SWAPS.index("sorted"))

    @property
    def swap_shown(self) -> Argument:
        """The swap in a message."""
        swap = self.known.swap
        return choice("swap", SWAPS[int(swap.max())] if is_concrete(swap) else "")

    @property
    def divides(self) -> jax.Array:
        """``[]`` bool: whether a random split gives more than one component."""
        return self.known.fractions[..., 0] < 1

    @property
    def is_split(self) -> jax.Array:
        """``[]`` bool: whether particles may divide into components; the same for all runs."""
        return jnp.asarray(self.keeps_components) | (self.fractions[0] < 1.0)


def sir(num_partitions: int) -> Ordering:
    """SIR, or Condensation: no resampling inside the frame ("Non-PS" in smith2004)."""
    check_whole("num_partitions", num_partitions, most=_MOST_PARTITIONS)
    return _ordering([range(num_partitions)], np.zeros(num_partitions, bool))


def ps(order: Sequence[int]) -> Ordering:
    """Partitioned sampling in one order, resampling after every stage but the last.

    Source: maccormick1999, section 5; smith2004, figure 1.
    """
    return _ordering([order], _all_but_last(len(order)))


def dps(
    num_partitions: int | None = None,
    orders: Sequence[Sequence[int]] | None = None,
    reassembly: str = "evidence",
) -> Ordering:
    """Distributed partitioned sampling: PS with a different order in each component.

    The particles are split at random, without replacement, into components whose sizes
    differ by at most one.  Source: smith2004, section 4 and figure 5.

    Args:
        num_partitions: P; the orders are the P circular shifts of 0..P-1.
        orders: alternatively, one permutation per component.  On a part tree, no child may precede
            its parent.
        reassembly: ``"evidence"`` weights each component by its prior mass times its evidence,
            which keeps the set properly weighted.  ``"literal"`` renormalises each component to its
            prior mass, as the paper does; this drops the components' evidence and biases the
            estimates at finite N (measured at N = 300: mean bias .083 against .021 on the hardest
            part).
    """
    if orders is None:
        check_whole("num_partitions", num_partitions, most=_MOST_PARTITIONS)
        base = list(range(num_partitions or 0))
        orders = [base[shift:] + base[:shift] for shift in base]
    check_known("reassembly=", reassembly, REASSEMBLIES)
    return _ordering(orders, _all_but_last(len(orders[0])), literal=reassembly == "literal")


def branched(orders: Sequence[Sequence[int]]) -> Ordering:
    """Branched partitioned sampling: the component of a particle is its discrete label.

    Particles follow ``orders[label]`` (``Partitioned.initial_label``).  Without labels they follow
    ``orders[state.component]`` and keep their component through resampling.  Branch sizes vary at
    run time and may be 0 (maccormick1999, figure 8).
    """
    return _ordering(orders, _all_but_last(len(orders[0])), keeps_components=True)


def sps(
    parents: Sequence[int] | None = None,
    swap: str = "combinatorial",
    *,
    num_partitions: int | None = None,
    exchange_roots: bool = True,
) -> Ordering:
    """Simultaneous partitioned sampling: level by level down the part tree.

    Each level's parts are propagated and weighted together.  Particles that share the draw of the
    parent then exchange these parts, and the set is resampled once, except after the last level.
    Source: gonzales2011, figures 3 to 6.

    Exchange is correct only if a part's motion and likelihood depend only on its own past and its
    parent, as ``jaxpf.contract.Dynamics`` requires.  Any other dependence between objects makes
    exchange silently wrong: use ``swap="none"``, or make the dependent object a child in the tree.

    Args:
        parents: the part tree, ``parents[p]`` the parent of part p and -1 for a root.
        swap: ``"combinatorial"`` resamples from the implicit set of all pairings (Dubuisson,
            Gonzales & Nguyen 2012) and is unbiased.  ``"sorted"`` pairs best with best, as
            gonzales2011 does.  It biases the evidence at any N, by an amount that depends on the
            model: E[Z^]/Z = 52 and a posterior variance of .59 of the exact one on a
            linear-Gaussian tree of three parts (a = .9, coupling .5, process noise 1, observation
            noise .3, T = 5, N = 30); E[Z^]/Z = 1.72 on the model of the notebook ``swap_bias``.
            ``"random"`` pairs at random; ``"none"`` does not exchange.
        num_partitions: instead of ``parents``, the number of independent objects (all roots).
        exchange_roots: whether to exchange roots, if there are several.  This is exact for objects
            without parts.  For roots with parts it adds an O(1/N) bias; ``False`` is exact.
    """
    if parents is None:
        check_whole("num_partitions", num_partitions, most=_MOST_PARTITIONS)
        parents = [-1] * (num_partitions or 0)
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
        # A level without exchange still records shared draws if a later level needs them.
        exchange_after=level_end & np.maximum.accumulate(exchanged[::-1])[::-1],
        swap=SWAPS.index(swap),
        tree=tree,
    )


def blocks(num_partitions: int) -> Ordering:
    """Block particle filter: partitions, the blocks, are resampled independently of each other.

    For many coupled coordinates, where filters of whole states collapse.  Every block is weighted
    by its own likelihood; a particle's next state is made of blocks of different particles.  This
    forgets the dependence between blocks after every frame.  With coupled dynamics the results are
    biased: the bias does not vanish with more particles.  For local, well-mixing dynamics it does
    not grow with the number of blocks, and is smaller for larger ones (Rebeschini & van Handel
    2015).  ``log_evidence`` is biased as well.  With independent partitions nothing is forgotten,
    and this is ``sps``.

    Args:
        num_partitions: P, number of blocks.
    """
    ordering = sps(num_partitions=num_partitions)
    return dataclasses.replace(ordering, forgets_coupling=as_array(True, bool))


def named(
    method: str,
    parents: Sequence[int],
    *,
    order: Sequence[int] | None = None,
    swap: str = "combinatorial",
) -> Ordering:
    """Build the ordering of a named method.

    Args:
        method: "sir", "ps", "dps" or "sps".
        parents: the part tree, -1 for a root; all -1 for independent objects.
        order: for "ps", all partitions, each after its parent.  Default: level by level, which for
            independent objects is 0, 1, ..., P-1.
        swap: for "sps"; roots are exchanged only if no root has parts.
    """
    tree = check_tree(parents)
    check_known("method ", method, METHODS)
    if order is not None and method != "ps":
        raise InputError(f"an order was given, but method {method!r} has none; use method 'ps'.")
    if order is not None and len(order) != len(tree):
        raise InputError(
            f"order {order} has {len(order)} entries for {len(tree)} objects; name every object "
            "once."
        )
    if method == "sps":
        # Keeps the exchange exact: roots with parts are not exchanged.
        return sps(tree, swap, exchange_roots=all(parent < 0 for parent in tree))
    if method == "dps":
        if any(parent >= 0 for parent in tree):
            raise InputError(
                "method 'dps' goes through circular shifts, which put parts before their parents; "
                "choose one of sir, ps, sps, or give orders of your own to ordering.dps."
            )
        return dps(len(tree))
    depth = tree_levels(tree)
    downwards = sorted(range(len(tree)), key=lambda part: (depth[part], part))
    if method == "sir":
        # Parents first, without resampling between stages.
        return _ordering([downwards], np.zeros(len(tree), bool))
    return ps(downwards if order is None else order)


def tree_levels(tree: Sequence[int]) -> list[int]:
    """Depth of each part below its root."""

    def depth(part: int) -> int:
        return 0 if tree[part] == -1 else 1 + depth(tree[part])

    return [depth(part) for part in range(len(tree))]


def _all_but_last(num_partitions: int) -> np.ndarray:
    return np.arange(num_partitions) < num_partitions - 1


def _check_permutation(order: Sequence[int], num_partitions: int, component: int) -> list[int]:
    if sorted(order) != list(range(num_partitions)) or not num_partitions:
        raise InputError(
            f"order {list(order)} of component {component} is not a permutation of "
            f"0..{max(num_partitions - 1, 0)}; name every partition exactly once."
        )
    return list(order)


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
    """Build an ordering, with tables padded to at least P components."""
    num_partitions = len(orders[0])
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
        forgets_coupling=as_array(False, bool),
        keeps_components=keeps_components,
    )


def carriers(order: np.ndarray, level: np.ndarray, tree: Sequence[int]) -> np.ndarray:
    """``[P, P]``: in stage j's level, the stage of stage r's part or of its ancestor; else -1."""
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
