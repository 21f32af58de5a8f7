"""Groups of partitions that are smoothed together, and checks whether a tracker can be smoothed.

Objects that are independent given the frames are smoothed separately: the distribution is the same
at lower variance, since no particle has to explain all objects at once.  Parts of one tree are
smoothed together: given only its parent's current value, a part still depends on the parent's past
(a pass per part was biased, z = 10.6 where the joint pass had 2.3).
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxpf import contract
from jaxpf.contract import calls
from jaxpf.contract.calls import at_frame, check_uncoupled
from jaxpf.contract.errors import InputError
from jaxpf.contract.optional import optional
from jaxpf.contract.pytree import is_concrete
from jaxpf.contract.refusals import refused
from jaxpf.contract.types import TrackerLike
from jaxpf.filters.functions import FunctionDynamics
from jaxpf.filters.partitioned.labels import moves_labels
from jaxpf.filters.partitioned.tracker import Partitioned
from jaxpf.smoothing.singular import singular_partitions

_SUPPORTED = (
    "supported are methods sir, ps, dps, branched, and sps but for swap='sorted' and for roots "
    "with children that are exchanged"
)
_TRACE = (
    'trace ancestors back by jaxpf.smooth(..., method="genealogy"), which needs no density of moves'
)


def together(tracker: Partitioned) -> list[tuple[np.ndarray, np.ndarray]]:
    """Group the partitions by backward pass, and stack groups of the same size.

    Returns:
        For each group size G: the partitions ``[Q, G]`` of its Q groups, and the index in the group
        of each partition's parent, -1 for a root.
    """
    parents = tracker.parents
    joint = (
        calls.has_log_joint(tracker.likelihood)
        or tracker.initial_label is not None
        or (callable(tracker.initial) and not optional(tracker.initial, "independent"))
    )
    groups: dict[int, list[int]] = {}
    for part in range(len(parents)):
        root = part
        while parents[root] >= 0:
            root = parents[root]
        groups.setdefault(0 if joint else root, []).append(part)
    stacked: dict[int, list[list[int]]] = {}
    for group in groups.values():
        stacked.setdefault(len(group), []).append(group)

    def places(group: list[int]) -> list[int]:
        return [group.index(parents[part]) if parents[part] >= 0 else -1 for part in group]

    return [
        (np.array(of_size, np.int32), np.array([places(group) for group in of_size], np.int32))
        for of_size in stacked.values()
    ]


def looks_back(tracker: Partitioned) -> bool:
    """Whether the transition density depends on the previous substate (second-order motion).

    Inspects the traced program, so any use of the argument counts, even without effect.
    """
    state = jax.eval_shape(tracker.init, jax.random.key(0))
    dynamics = at_frame(tracker, 0).dynamics
    substates = jax.ShapeDtypeStruct((state.lagged.shape[1], 1), state.lagged.dtype)

    def of_previous(previous: jax.Array) -> jax.Array:
        other = jnp.ones(previous.shape, previous.dtype)
        partition = jnp.zeros((1,), jnp.int32)
        return contract.log_density_all(dynamics, partition, other, other, previous, other)

    program = jax.make_jaxpr(of_previous)(substates).jaxpr
    previous = program.invars[0]
    return any(previous is used for equation in program.eqns for used in equation.invars)


def sees_previous(tracker: Partitioned) -> bool:
    """Whether the likelihood depends on the previous state, which a particle then holds too."""
    return isinstance(tracker.dynamics, FunctionDynamics) and tracker.dynamics.copies == 2


def check_genealogy(tracker: TrackerLike) -> jax.Array | None:
    """Refuse trackers whose particles have no ancestors, or the wrong weights.

    Returns:
        As ``check_smoothing``.

    Raises:
        InputError: names the setting and an alternative.
    """
    if not isinstance(tracker, Partitioned):
        raise InputError(
            f"{type(tracker).__name__} cannot be smoothed, as its particles hold no whole states "
            f"with one weight each; {_SUPPORTED}."
        )
    if tracker.gradient.blends:
        raise InputError(
            "Transport blends particles, which then come from no single move, and "
            "cannot be smoothed; use another gradient."
        )
    ordering, parents = tracker.ordering, tracker.parents
    paired = sorted({parent for parent in parents if parent >= 0 and parents[parent] < 0})
    return refused(
        (
            tracker.refused,
            ("the ordering does not work with the model; build the tracker outside of jit.",),
        ),
        (
            ordering.exchanges_best,
            (
                "swap='sorted' pairs parts by their likelihoods, and its weights are biased, so "
                "that there is nothing to smooth; use swap='combinatorial'.",
            ),
        ),
        (
            ordering.exchanges_roots & bool(paired),
            (
                f"the ordering exchanges roots that have children ({paired}), which pairs again "
                "what has different pasts; smooth with sps(..., exchange_roots=False), or with "
                "another method.",
            ),
        ),
    )


def check_smoothing(tracker: Partitioned, whole: bool = False) -> jax.Array | None:
    """Refuse trackers whose smoothed distribution is undefined or would be wrong.

    Args:
        tracker: any tracker.
        whole: whether the frames of the whole clip are at hand in the backward pass.

    Returns:
        Bool, whether a traced ordering is one to refuse, see ``contract.refusals``; or None.

    Raises:
        InputError: names the setting and an alternative.
    """
    refuse = check_genealogy(tracker)
    check_uncoupled(tracker.dynamics, "smoothing")
    dynamics = type(tracker.dynamics).__name__
    if not calls.has_log_density(tracker.dynamics):
        raise InputError(
            f"smoothing needs the density of a move, and {dynamics} has none; add the method "
            "log_density(partition, new, current, previous, parent) -> [], the log of the density "
            "from which propagate draws (see jaxpf.contract.DynamicsWithDensity), give "
            f"jaxpf.state_space a transition_log_density, or {_TRACE}."
        )
    if moves_labels(tracker) and not calls.has_log_label(tracker.dynamics):
        raise InputError(
            f"smoothing needs the probability of a label's move, and {dynamics} has none; add the "
            "method log_label(new, label, substates) -> [], the log-probability with which "
            "propagate_label draws (see jaxpf.contract)."
        )
    if sees_previous(tracker) and not whole:
        raise InputError(
            "a log_likelihood that asks for the previous state is smoothed over the whole clip "
            "alone; use jaxpf.smooth without a lag."
        )
    if is_concrete(tracker.dynamics, tracker.initial):
        _check_noise(tracker)
    return refuse


def _check_noise(tracker: Partitioned) -> None:
    dynamics: Any = tracker.dynamics
    size = None
    if sees_previous(tracker):  # the likelihood has its own factor for the previous state
        size = dynamics.layout.size
    singular = singular_partitions(dynamics, tracker.initial, tracker.parents, size)
    if singular:
        name = "transition_log_density"
        if not isinstance(dynamics, FunctionDynamics):
            name = f"{type(dynamics).__name__}.log_density (partitions {singular})"
        raise InputError(
            f"{name} leaves out a direction in which particles differ and the motion has no "
            f"noise, so that smoothing by densities would be wrong; {_TRACE}."
        )
