"""Frames as users give them, brought into one form; and what is said of frames that go wrong."""

import contextlib
import warnings
from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple

import jax
import numpy as np

from jaxpf import contract
from jaxpf.contract.calls import optional, unwrapped
from jaxpf.contract.errors import InputError
from jaxpf.contract.numbers import with_nan
from jaxpf.contract.pytree import is_concrete
from jaxpf.contract.state import Summary
from jaxpf.contract.types import TrackerLike


class Frames(NamedTuple):
    """Frames, or other rows of a sequence, in one of two forms.

    Attributes:
        whole: pytree of arrays ``[T, ...]``; None if frames come one by one.
        source: iterable of single frames; None if they are whole.
    """

    whole: Any
    source: Iterable[Any] | None = None

    def stacked(self) -> Any:
        """The arrays.

        Raises:
            InputError: frames come one by one.
        """
        if self.source is not None:
            raise InputError(
                "frames come one by one, and are needed all at once; give np.stack(list(frames)), "
                "or use jaxpf.stream, jaxpf.monte_carlo or a lag, which keep few of them."
            )
        return self.whole

    def one_by_one(self) -> Iterator[Any]:
        """Single frames."""
        if self.source is not None:
            yield from (as_arrays(frame) for frame in self.source)
            return
        for place in range(num_frames(self.whole)):
            yield jax.tree.map(lambda x, place=place: x[place], self.whole)


def frames_of(given: Any) -> Frames:
    """Take frames as a user gives them: arrays, tables, a pytree of these, or an iterable."""
    if isinstance(given, Frames):
        return given
    is_array = isinstance(given, np.ndarray | jax.Array) or hasattr(given, "to_numpy")
    is_tree = not isinstance(given, list) and not jax.tree_util.all_leaves([given])
    if is_array or is_tree or not isinstance(given, Iterable):
        return Frames(as_arrays(given))
    return Frames(None, given)


def as_arrays(tree: Any) -> Any:
    """NaN where tables and masked arrays of a pytree have no entry; see ``with_nan``."""
    return jax.tree.map(with_nan, tree)


def num_frames(frames: Any) -> int:
    """Return the length of the leading axis of all arrays; refuse none, and different ones."""
    lengths = {np.shape(leaf)[0] for leaf in jax.tree.leaves(frames)}
    if len(lengths) != 1 or 0 in lengths:
        raise InputError(
            f"frames have leading axes {sorted(lengths)}; give at least one frame, and the same "
            "number of frames in every array."
        )
    return lengths.pop()


@contextlib.contextmanager
def noted(tracker: TrackerLike) -> Iterator[None]:
    """Add what a model's methods return to an exception: JAX tells the shapes, but not whose."""
    try:
        yield
    except InputError:
        raise
    except Exception as error:
        inner = unwrapped(tracker)
        parts = {name: getattr(inner, name, None) for name in ("dynamics", "likelihood")}
        named = [
            f"{name} {type(part).__name__}" for name, part in parts.items() if part is not None
        ]
        count = optional(tracker, "num_partitions")
        error.add_note(
            f"In a run of {type(inner).__name__} ({', '.join(named)}) with {count} partitions.  "
            "For one particle of D coordinates propagate returns [D], and log_prob one number; "
            "classes are registered by jaxpf.pytree_dataclass (see jaxpf.contract)."
        )
        raise


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
    if not isinstance(summary, Summary) or not is_concrete(summary.status):
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
