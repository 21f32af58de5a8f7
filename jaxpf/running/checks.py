"""Checks of users' classes and frames before compilation.

JAX would detect most errors too, but later and with messages about its internals.
"""

import functools
import warnings
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxpf import contract
from jaxpf.contract.errors import InputError, check_tracker
from jaxpf.contract.numbers import returned, with_nan
from jaxpf.contract.pytree import is_concrete
from jaxpf.contract.types import TrackerLike
from jaxpf.running.chunks import come_one_by_one

#: Number of particles in a trial call, chosen to differ from other axes.
_TRIED = 3
#: Parts of a tracker, and methods of which each has at least one.
_METHODS = (
    ("dynamics", ("propagate", "propagate_all", "at_frame")),
    ("likelihood", ("log_prob", "log_prob_all", "at_frame")),
    ("likelihood", ("observe",)),
    ("proposal", ("propose", "propose_all", "of_model")),
)


def check_run(tracker: TrackerLike, frames: Any) -> None:
    """Refuse a tracker or frames that cannot run.

    Args:
        tracker: any tracker.
        frames: as for ``jaxpf.run``.

    Raises:
        InputError: a class that is not a pytree; frames that are a list or complex; methods of the
            dynamics or the likelihood that return a wrong type or shape.
    """
    check_pytree(tracker)
    check_frames(frames)
    if not all(hasattr(tracker, name) for name in ("dynamics", "likelihood", "initial")):
        return
    for name, methods in _METHODS:
        part = getattr(tracker, name, None)
        wanted = part is not None or name != "proposal"
        if wanted and not any(hasattr(part, method) for method in methods):
            raise InputError(f"{name} is {part!r:.60}, without a method {methods[0]}; write one.")
    first = jax.tree.map(
        lambda x: jax.ShapeDtypeStruct(np.shape(x)[1:], jnp.result_type(x)), frames
    )
    # Needs the tracker itself, not its structure: it may draw from its initial sampler.
    num_partitions = contract.optional(tracker, "num_partitions")
    _check_methods.eval_shape(tracker, first, num_partitions)


def check_order(tracker: TrackerLike, key: object, frames: Any) -> None:
    """Refuse a tracker, keys and frames that were given in another order.

    Raises:
        InputError: gives the order.
    """
    kinds = [getattr(value, "dtype", None) for value in (tracker, frames)]
    keys = [kind is not None and jax.dtypes.issubdtype(kind, jax.dtypes.prng_key) for kind in kinds]
    if any(keys) or hasattr(key, "init") or hasattr(frames, "init"):
        raise InputError(
            "the arguments are in another order; give the tracker, then the random key or keys, "
            "then the frames."
        )


def check_pytree(tracker: TrackerLike) -> None:
    """Refuse what is no tracker, and a tracker that contains an object that is not a pytree.

    Raises:
        InputError: names the class and its place.
    """
    check_tracker(tracker)
    for path, leaf in jax.tree_util.tree_leaves_with_path(tracker):
        if isinstance(leaf, np.ndarray | np.generic | jax.Array | int | float | complex):
            continue
        place = f"tracker{jax.tree_util.keystr(path)}"
        raise InputError(
            f"{place} is {_a(type(leaf).__name__)}, which is not a pytree; decorate the class with "
            "@jaxpf.pytree_dataclass, or give numbers."
        )


def as_arrays(frames: Any) -> Any:
    """Apply ``with_nan`` to all arrays; frames that come one by one stay as they are."""
    if come_one_by_one(frames) and not hasattr(frames, "to_numpy"):
        return frames
    return jax.tree.map(with_nan, frames)


def warn_of_frames(
    summary: object, frame_at: Callable[[int], Any] | None = None, first: int = 0, told: int = 0
) -> int:
    """Warn of the first frame that no particle explains, and of the first with invalid likelihoods.

    Args:
        summary: what a run recorded, of frames on its last axis; checked if it is a ``Summary``.
        frame_at: place on that axis -> frame; None if frames were not kept.
        first: number of the first frame.
        told: sum of the bits of ``Summary.status`` of which the user was warned before.

    Returns:
        ``told``, with the bits of these warnings.
    """
    if not isinstance(summary, contract.Summary) or not is_concrete(summary.status):
        return told
    status, num_invalid = np.atleast_1d(summary.status), np.atleast_1d(summary.num_invalid)
    impossible = status & contract.STATUS_IMPOSSIBLE > 0
    invalid = (status & contract.STATUS_INVALID_LIKELIHOOD > 0) & ~impossible
    for bit, bad in (
        (contract.STATUS_IMPOSSIBLE, impossible),
        (contract.STATUS_INVALID_LIKELIHOOD, invalid),
    ):
        places = np.argwhere(bad)
        if told & bit or not len(places):
            continue
        told |= bit
        place = tuple(places[places[:, -1].argmin()])
        number = num_invalid[place]
        if bit == contract.STATUS_INVALID_LIKELIHOOD:
            what = f"NaN or +inf {number} times; those particles count as impossible"
        elif number:
            what = "NaN or +inf, and finite for no particle of a run, whose evidence is then 0"
        else:
            what = "-inf for every particle of a run, whose evidence is then 0"
        shown = "" if frame_at is None else f" The frame is {_in_short(frame_at(place[-1]))}."
        warnings.warn(
            f"the log-likelihood of frame {first + int(place[-1])} is {what}; see Summary.status "
            f"and Summary.num_invalid.{shown}",
            stacklevel=3,
        )
    return told


def _in_short(frame: Any) -> str:
    """The numbers of a frame; of an array of many its shape."""

    def shown(leaf: Any) -> str:
        leaf = np.asarray(leaf)
        if leaf.size > 10:
            return f"{leaf.dtype} {list(leaf.shape)}"
        return " ".join(np.array2string(leaf, separator=", ").split())

    return str(jax.tree.map(shown, frame)).replace("'", "")


def check_frames(frames: object) -> None:
    """Refuse frames that are a list, not numbers, or complex.

    Raises:
        InputError: names the problem.
    """
    if isinstance(frames, list):
        raise InputError(
            f"frames is a list of {len(frames)}; give one array [T, ...]: np.stack(frames)."
        )
    for leaf in jax.tree.leaves(frames):
        if isinstance(leaf, np.ndarray) and leaf.dtype.kind in "OUS":
            raise InputError(f"frames hold {leaf.dtype} arrays; give arrays of numbers.")
        if not hasattr(leaf, "dtype"):
            raise InputError(
                f"frames hold {_a(type(leaf).__name__)}; give arrays with a leading axis of time."
            )
        if jnp.issubdtype(jnp.result_type(leaf), jnp.complexfloating):
            raise InputError("frames hold complex numbers; give real ones.")


@functools.partial(jax.jit, static_argnums=2)
def _check_methods(tracker: Any, frame: Any, num_partitions: int | None) -> None:
    """Check the shapes that a model's methods return; only traced, once per kind of tracker."""
    key = jax.eval_shape(lambda: jax.random.key(0))
    initial = tracker.initial
    if callable(initial):
        initial = jax.eval_shape(lambda filter_, key: filter_.initial(key), tracker, key)
        returned(initial, (num_partitions, None), "the initial sampler", f"[{num_partitions}, D]")
    size, kind = initial.shape[-1], initial.dtype
    substate = jax.ShapeDtypeStruct((size,), kind)
    place = jax.ShapeDtypeStruct((), jnp.int32)
    many = jax.ShapeDtypeStruct((size, _TRIED), kind)
    places = jax.ShapeDtypeStruct((_TRIED,), jnp.int32)

    def tried(part: object, method: Callable, *arguments: Any) -> Any:
        """Shapes that a method returns; errors of a class of ours come from shapes of arrays."""
        try:
            return jax.eval_shape(method, *arguments)
        except InputError:
            raise
        except (IndexError, TypeError, ValueError) as error:
            if not type(part).__module__.startswith("jaxpf."):
                raise
            reason = str(error).partition("\n")[0].rstrip(".")
            raise InputError(
                f"{type(part).__name__} does not fit {num_partitions} partitions of {size} "
                f"coordinates, or the frames ({reason}); check the shapes of its arrays."
            ) from error

    motion = jax.eval_shape(lambda filter_: contract.first_motion(filter_.dynamics), tracker)
    coupled = contract.is_coupled(motion)

    def others(substates: Any) -> list[jax.ShapeDtypeStruct]:
        whole = jax.ShapeDtypeStruct((num_partitions, *substates.shape), kind)
        return [whole] if coupled else []

    by_partition = contract.optional(tracker.dynamics, "by_partition")
    for name in by_partition:  # of several rows, one for each
        rows: Any = getattr(getattr(tracker.dynamics, name), "shape", ())
        if len(rows) > 1 and rows[0] not in (1, num_partitions):
            raise InputError(
                f"{type(tracker.dynamics).__name__}.{name} has shape {list(rows)}, but there are "
                f"{num_partitions} partitions; give a row for each, or one for all."
            )

    def check_first(name: str, base: type, *methods: tuple[str, tuple, tuple[int, ...], str]):
        """Try the first of these methods that a part defines."""
        part = getattr(tracker, name)
        defined = [row for row in methods if _defines(part, base, row[0])]
        for method, arguments, shape, wanted in defined[:1]:

            def call(filter_, *arguments, method=method):
                return getattr(getattr(contract.at_frame(filter_, 0), name), method)(*arguments)

            value = tried(part, call, tracker, *arguments)
            returned(value, shape, f"{type(part).__name__}.{method}", wanted)

    of_many = (key, places, many, many, many, *others(many))
    of_one = (key, place, substate, substate, substate, *others(substate))
    check_first(
        "dynamics",
        contract.CoupledDynamics if coupled else contract.Dynamics,
        ("propagate_all", of_many, many.shape, "the moved substates [D, N]"),
        ("propagate", of_one, substate.shape, "the moved substate [D]"),
    )
    seen = tried(
        tracker.likelihood,
        lambda filter_, frame: contract.observed_apart(filter_)[0](frame),
        *(tracker, frame),
    )
    estimates = jax.ShapeDtypeStruct((num_partitions, *substate.shape), substate.dtype)
    seen = tried(
        tracker.likelihood,
        lambda filter_, seen, near: contract.look_near(filter_.likelihood, seen, lambda: near),
        *(tracker, seen, estimates),
    )
    check_first(
        "likelihood",
        contract.Likelihood,
        ("log_prob_all", (seen, places, many), (_TRIED,), "one number for each, [N]"),
        ("log_prob", (seen, place, substate), (), "a single number"),
    )


def _defines(part: object, base: type, name: str) -> bool:
    own = getattr(type(part), name, None)
    return own is not None and own is not getattr(base, name)


def _a(noun: str) -> str:
    return f"{'an' if noun[:1].lower() in 'aeiou' else 'a'} {noun}"
