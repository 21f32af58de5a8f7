"""Coordinates whose moves have no noise, so that the transition density leaves them out."""

import contextlib

import jax
import jax.numpy as jnp
import numpy as np

from jaxpf import contract
from jaxpf.contract import calls
from jaxpf.contract.calls import optional
from jaxpf.contract.errors import InputError
from jaxpf.contract.pytree import is_concrete
from jaxpf.contract.types import HoldsModel
from jaxpf.filters.layout import Layout


def noiseless(tracker: HoldsModel) -> tuple[jax.Array | np.ndarray, jax.Array | np.ndarray]:
    """Find coordinates that a transition density ignores, by one move from near the initial state.

    Where a density is not finite there, nothing is known of it, and nothing found.

    Args:
        tracker: with ``initial``, and ``dynamics`` that have a density.

    Returns:
        Bool ``[P, D]``, traced if the dynamics are: coordinates of which a new value changes no
        density, and those among them that move all the same.

    Raises:
        InputError: the dynamics ask for inputs, which are not given yet.
    """
    dynamics = tracker.dynamics
    if optional(dynamics, "with_inputs") and getattr(dynamics, "inputs", ()) is None:
        raise InputError(
            "a transition that takes u cannot be checked for noise, which motion_gradient='score' "
            "and linearised proposals need; let it take time instead, and read row time of an "
            "array in parameters."
        )
    dynamics, initial = calls.first_motion(dynamics), tracker.initial
    known = is_concrete(dynamics, initial)
    with jax.ensure_compile_time_eval() if known else contextlib.nullcontext():
        keys = jax.random.split(jax.random.key(0), 3)
        start = jnp.asarray(initial(keys[0]) if callable(initial) else initial, float).T  # [D, P]
        # Apart from one another, so that velocities are not 0.
        past = start + jax.random.normal(keys[1], (3, *start.shape), start.dtype)
        partition = jnp.arange(start.shape[1])
        new = contract.propagate_all(dynamics, keys[2], partition, *past).astype(start.dtype)

        def density(new):
            return contract.log_density_all(dynamics, partition, new, *past)

        base, slope = density(new), jax.grad(lambda new: jnp.sum(density(new)))(new)
        far = 1e3 * (1 + jnp.abs(new))
        moves = [new.at[d].add(sign * far[d]) for sign in (1, -1) for d in range(len(new))]
        others = jnp.stack(list(map(density, moves))).reshape(2, *new.shape)
        # Compiled differently, equal densities differ in their last bits.
        same = jnp.all(jnp.abs(others - base) <= 1e-4 * (1 + jnp.abs(base)), axis=0)
        ignored = (slope == 0) & same & jnp.isfinite(base)
        found = ignored.T, (ignored & (new != past[0])).T
        return jax.tree.map(np.asarray, found) if known else found


def without_noise(
    what: str, tracker: HoldsModel, moved: bool = False, dimension: int | None = None
) -> tuple[jax.Array | np.bool_, tuple[str, ...]]:
    """The case that a coordinate has no noise, for ``refused``.

    Args:
        what: the setting that needs noise.
        tracker: as for ``noiseless``.
        moved: whether only coordinates that move matter.
        dimension: number of leading coordinates that matter; default all.
    """
    dynamics = tracker.dynamics
    wrong = noiseless(tracker)[int(moved)][:, :dimension]
    if isinstance(layout := getattr(dynamics, "layout", None), Layout):
        # Integers have no slope; a model of functions may hold the state before, too.
        wrong = wrong[:, : layout.size] & layout.is_float
    where = "a coordinate"
    if is_concrete(wrong) and wrong.any():
        where = "coordinate {1} of partition {0}".format(*np.argwhere(wrong)[0])
    return wrong.any(), (
        f"{what} needs noise in the motion of every coordinate, and the density of "
        f"{type(dynamics).__name__} leaves out {where}; give it some noise, or leave {what} out.",
    )
