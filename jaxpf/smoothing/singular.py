"""Singular transitions: moves without noise in some direction, which have no density.

Backward simulation asks how likely a particle's next substate is from every other particle.  If a
direction has no noise, a move from another particle is impossible, and a density of the noisy
directions alone does not say so: smoothed estimates and spreads are then wrong.  A direction in
which all particles hold the same value does no harm.
"""

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from jaxpf import contract
from jaxpf.contract import calls
from jaxpf.contract.types import DynamicsLike, Initial
from jaxpf.filters.initial import as_floats
from jaxpf.lowering.programs import compiled

#: Frames that particles move before they are compared: noise needs some to reach all directions.
_FRAMES = 8
_PARTICLES = 256


class _Moves(NamedTuple):
    """Trial moves of one partition with n particles; a row for each partition.

    Attributes:
        own: ``[D, n]``, a move of each particle.
        same: ``[D, n]``, moves of the first particle.
        apart: ``[D, n]``, moves from pasts that differ in coordinates that are ``ignored`` alone.
        ignored: ``[D]`` bool, coordinates of a move that change nothing in its density.
        log_from_first: ``[n]``, log-density of ``own`` from the first particle.
        log_same: ``[n]``, log-density of ``same``.
    """

    own: jax.Array
    same: jax.Array
    apart: jax.Array
    ignored: jax.Array
    log_from_first: jax.Array
    log_same: jax.Array


def singular_partitions(
    dynamics: DynamicsLike, initial: Initial, parents: tuple[int, ...], dimension: int | None = None
) -> list[int]:
    """Partitions whose density is positive for moves that the dynamics cannot make.

    Args:
        dynamics: with a density, and concrete.
        initial: as for ``jaxpf.Partitioned``.
        parents: ``[P]``, the part tree.
        dimension: number of leading coordinates to look at; default all.
    """
    with jax.ensure_compile_time_eval():
        moves = jax.tree.map(np.asarray, _trial(dynamics, initial, parents))
    of_parts = [jax.tree.map(lambda x, part=part: x[part], moves) for part in range(len(parents))]
    return [part for part, each in enumerate(of_parts) if _is_singular(each, dimension)]


@partial(
    compiled,
    static_argnames="parents",
    compiler_options={
        "xla_backend_optimization_level": 0,
        "xla_llvm_disable_expensive_passes": True,
    },
)
def _trial(dynamics: DynamicsLike, initial: Initial, parents: tuple[int, ...]) -> _Moves:
    start_key, frames_key, end_key = jax.random.split(jax.random.key(0), 3)
    shape = jax.eval_shape(initial, start_key).shape if callable(initial) else jnp.shape(initial)
    count, parent_of = _PARTICLES + 2 * shape[1], np.asarray(parents)
    if callable(initial):
        start = jax.vmap(initial)(jax.random.split(start_key, count))
    else:
        start = jnp.broadcast_to(initial, (count, *shape))
    start = jnp.moveaxis(as_floats(start), 0, -1)  # [P, D, n]
    parts = np.arange(len(parents))
    rounds = [part for part in parts if parents[part] < 0]
    for part in rounds:  # parents first
        rounds += [child for child in parts if parents[child] == part]

    def parent_in(new, part):
        return jnp.where(jnp.asarray(parent_of)[part] >= 0, new[jnp.asarray(parent_of)[part]], 0.0)

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

        new = lax.scan(lambda new, part: (move(new, part), None), current, np.array(rounds))[0]
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
        known = jnp.isclose(jnp.stack(swapped), log_own, 100 * jnp.finfo(log_own.dtype).eps)
        ignored = jnp.all(known, axis=1)
        pasts = jnp.where(ignored[:, None], mine, first)
        apart = draw((jax.random.fold_in(end_key, len(parents)), pasts))
        return _Moves(own, same, apart, ignored, log_from_first, log_same)

    return lax.map(of_part, parts)


def _is_singular(moves: _Moves, dimension: int | None) -> bool:
    precision = np.finfo(moves.own.dtype).eps
    own, same, apart = (np.asarray(x[:dimension], float) for x in moves[:3])
    if not all(np.isfinite(x).all() for x in (own, same, apart)):
        return False
    scale = np.std(np.hstack([own, same]), axis=1, keepdims=True)
    rounding = 8 * precision * np.max(np.abs(np.hstack([own, same])), axis=1, keepdims=True)
    varies = scale > rounding
    centre = np.mean(same, axis=1, keepdims=True)
    # Coordinates of which the density knows nothing, although they depend on their own past.
    ignored = moves.ignored[:dimension, None]
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
    fall = np.min(moves.log_same) - moves.log_from_first
    return bool(np.any((away > 10 * tolerance) & (fall < (away / tolerance) ** 2 / 4)))
