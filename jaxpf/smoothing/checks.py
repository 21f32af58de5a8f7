"""Which trackers can be smoothed; and singular transitions, whose moves have no density.

Backward simulation asks how likely a particle's next substate is from every other particle.  If a
direction has no noise, a move from another particle is impossible, and a density of the noisy
directions alone does not say so: smoothed estimates and spreads are then wrong.  A direction in
which all particles hold the same value does no harm.
"""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from jaxpf import contract
from jaxpf.contract import calls
from jaxpf.contract.calls import at_frame, check_uncoupled
from jaxpf.contract.errors import InputError
from jaxpf.contract.pytree import is_concrete
from jaxpf.contract.refusals import refused
from jaxpf.contract.types import DynamicsLike, Initial, TrackerLike
from jaxpf.filters.initial import as_floats
from jaxpf.filters.partitioned.tracker import Partitioned
from jaxpf.lowering.programs import compiled
from jaxpf.ordering import tree_levels

_SUPPORTED = (
    "supported are methods sir, ps, dps, branched, and sps but for swap='sorted' and for roots "
    "with children that are exchanged"
)
_TRACE = (
    'trace ancestors back by jaxpf.smooth(..., method="genealogy"), which needs no density of moves'
)
#: Frames that particles move before they are compared: noise needs some to reach all directions.
_FRAMES = 8
_PARTICLES = 256


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
    if tracker.moves_labels and not calls.has_log_label(tracker.dynamics):
        raise InputError(
            f"smoothing needs the probability of a label's move, and {dynamics} has none; add the "
            "method log_label(new, label, substates) -> [], the log-probability with which "
            "propagate_label draws (see jaxpf.contract)."
        )
    if tracker.sees_previous and not whole:
        raise InputError(
            "a log_likelihood that asks for the previous state is smoothed over the whole clip "
            "alone; use jaxpf.smooth without a lag."
        )
    if is_concrete(tracker.dynamics, tracker.initial) and (found := singular_partitions(tracker)):
        raise InputError(
            f"the density of {dynamics} (partitions {found}) leaves out a direction in which "
            f"particles differ and the motion has no noise, so that smoothing by densities would "
            f"be wrong; {_TRACE}."
        )
    return refuse


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


def singular_partitions(tracker: Partitioned) -> list[int]:
    """Partitions whose density is positive for moves that the dynamics cannot make.

    Args:
        tracker: its dynamics have a density and are concrete, as is its initial state.
    """
    with jax.ensure_compile_time_eval():
        trial = _trial(tracker.dynamics, tracker.initial, tracker.parents)
    own, same, apart, ignored, *log_densities = map(np.asarray, trial)
    # The likelihood has its own factor for the previous state that a substate may hold.
    dimension = own.shape[1] // (1 + tracker.sees_previous)
    by_coordinate = (x[:, :dimension] for x in (own, same, apart, ignored))
    rows = zip(*by_coordinate, *log_densities, strict=True)
    return [part for part, row in enumerate(rows) if _is_singular(*row)]


@partial(
    compiled,
    static_argnames="parents",
    compiler_options={
        "xla_backend_optimization_level": 0,
        "xla_llvm_disable_expensive_passes": True,
    },
)
def _trial(
    dynamics: DynamicsLike, initial: Initial, parents: tuple[int, ...]
) -> tuple[jax.Array, ...]:
    """Trial moves of n particles, a row for each partition.

    Args:
        dynamics: of the model.
        initial: as for ``jaxpf.Partitioned``.
        parents: ``[P]``, the part tree.

    Returns:
        Moves ``[P, D, n]`` of each particle, of the first particle, and of particles whose pasts
        differ in ignored coordinates alone; ``[P, D]`` bool, coordinates of a move that its density
        ignores; and log-densities ``[P, n]`` of the first two moves from the first particle.
    """
    start_key, frames_key, end_key = jax.random.split(jax.random.key(0), 3)
    shape = jax.eval_shape(initial, start_key).shape if callable(initial) else jnp.shape(initial)
    count = _PARTICLES + 2 * shape[1]
    if callable(initial):
        start = jax.vmap(initial)(jax.random.split(start_key, count))
    else:
        start = jnp.broadcast_to(initial, (count, *shape))
    start = jnp.moveaxis(as_floats(start), 0, -1)  # [P, D, n]
    parents_first = np.argsort(tree_levels(parents))
    parent_of = jnp.asarray(parents)

    def parent_in(new, part):
        return jnp.where(parent_of[part] >= 0, new[parent_of[part]], 0.0)

    def propagate(motion, key, part, current, previous, parent):
        partition = jnp.full(count, part)
        moved = contract.propagate_all(motion, key, partition, current, previous, parent)
        return moved.astype(start.dtype)

    def move_all(lagged, item):
        current, previous = lagged
        motion, key = calls.of_frame(dynamics, item[0]), item[1]

        def move(new, part):
            given = current[part], previous[part], parent_in(new, part)
            return new.at[part].set(propagate(motion, jax.random.fold_in(key, part), part, *given))

        new = lax.scan(lambda new, part: (move(new, part), None), current, parents_first)[0]
        return (new, current), new

    items = jnp.arange(_FRAMES), jax.random.split(frames_key, _FRAMES)
    *_, previous, current, new = lax.scan(move_all, (start, start), items)[1]
    motion = calls.of_frame(dynamics, _FRAMES - 1)

    def of_part(part):
        # The parent is the first particle's, so that the parts alone differ.
        parent = jnp.broadcast_to(parent_in(new, part)[:, :1], new.shape[1:])
        mine = jnp.stack([current[part], previous[part]])
        first = jnp.broadcast_to(mine[..., :1], mine.shape)

        def draw(item):
            key, (current, previous) = item
            return propagate(motion, key, part, current, previous, parent)

        def density(item):
            partition, (moved, (current, previous)) = jnp.full(count, part), item
            return contract.log_density_all(motion, partition, moved, current, previous, parent)

        keys = jax.random.split(jax.random.fold_in(end_key, part))
        own, same = lax.map(draw, (keys, jnp.stack([mine, first])))
        swapped = [own.at[row].set(jnp.roll(own[row], 1)) for row in range(shape[1])]
        to = jnp.stack([own, own, same, *swapped])
        by = jnp.stack([mine, first, first, *[mine] * shape[1]])
        log_own, log_from_first, log_same, *swapped = lax.map(density, (to, by))
        alike = jnp.isclose(jnp.stack(swapped), log_own, 100 * jnp.finfo(log_own.dtype).eps)
        ignored = jnp.all(alike, axis=1)
        pasts = jnp.where(ignored[:, None], mine, first)
        apart = draw((jax.random.fold_in(end_key, len(parents)), pasts))
        return own, same, apart, ignored, log_from_first, log_same

    return lax.map(of_part, np.arange(len(parents)))


def _is_singular(
    own: np.ndarray,
    same: np.ndarray,
    apart: np.ndarray,
    ignored: np.ndarray,
    log_from_first: np.ndarray,
    log_same: np.ndarray,
) -> bool:
    """Whether one partition's trial moves have no density; see ``_trial``."""
    precision = np.finfo(own.dtype).eps
    own, same, apart = (x.astype(float) for x in (own, same, apart))
    if not all(np.isfinite(x).all() for x in (own, same, apart)):
        return False
    scale = np.std(np.hstack([own, same]), axis=1, keepdims=True)
    rounding = 8 * precision * np.max(np.abs(np.hstack([own, same])), axis=1, keepdims=True)
    varies = scale > rounding
    centre = np.mean(same, axis=1, keepdims=True)
    # Coordinates of which the density knows nothing, although they depend on their own past.
    ignored = ignored[:, None]
    of_same, of_apart = (np.mean((x - centre) ** 2, axis=1, keepdims=True) for x in (same, apart))
    if np.any(ignored & (of_apart > 1.5 * of_same + rounding**2)):
        return True
    # A direction across coordinates in which a particle's moves do not differ, and others' do.
    noisy = (varies & ~ignored & (np.ptp(same, axis=1, keepdims=True) > 0))[:, 0]
    if not noisy.any():
        return False
    tolerance = np.max(rounding[noisy] / scale[noisy])
    directions, sizes, _ = np.linalg.svd((same - centre)[noisy] / scale[noisy])
    fixed = directions[:, sizes / np.sqrt(same.shape[1]) <= tolerance]
    away = np.linalg.norm(fixed.T @ ((own - centre)[noisy] / scale[noisy]), axis=0)
    # The least fall of the log-density that noise as small as rounding would bring.
    fall = np.min(log_same) - log_from_first
    return bool(np.any((away > 10 * tolerance) & (fall < (away / tolerance) ** 2 / 4)))
