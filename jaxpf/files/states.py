"""Saves a filter's state to disk and loads it to resume tracking."""

import hashlib
import os
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxpf.contract.errors import InputError
from jaxpf.contract.types import TrackerLike
from jaxpf.files.store import DIGEST, open_arrays, write_arrays

#: Version of the file format; other versions are refused.
_FORMAT = 2
_STATE, _FORMAT_NAME = "state", "format"


def save(path: str | os.PathLike[str], state: object) -> None:
    """Write a tracker's state to a file, which appears under its name only when complete.

    The file is a NumPy ``.npz`` archive of arrays.  It contains neither code nor the tracker
    itself: to resume, build the same tracker again from the same start frame.

    Example::

        state, _ = jaxpf.run(tracker, key, y)
        jaxpf.save("state.npz", state)

    Args:
        path: the file.
        state: of any tracker, a pytree of arrays and random keys.

    Raises:
        InputError: the file cannot be written.
    """
    arrays = {_STATE + place: _plain(leaf) for place, leaf in _leaves(state)}
    write_arrays(Path(path), {_FORMAT_NAME: np.array(_FORMAT), **arrays})


def load(path: str | os.PathLike[str], tracker: TrackerLike) -> Any:
    """Load the state that ``save`` wrote.

    Example::

        state = jaxpf.load("state.npz", tracker)
        state, summary = jaxpf.run(tracker, key, later, state=state)

    Args:
        path: the file.
        tracker: the tracker that resumes; it must match the saved one.

    Returns:
        The state, for ``state=`` of ``jaxpf.run`` and ``jaxpf.stream``.

    Raises:
        InputError: the file cannot be read, or its state belongs to another filter or to another
            number of particles or objects.
    """
    wanted = jax.eval_shape(tracker.init, jax.random.key(0))
    return load_like(path, wanted, type(tracker).__name__)


def load_like(path: str | os.PathLike[str], wanted: Any, kind: str) -> Any:
    """Load what ``save`` wrote, of the structure, shapes and types of ``wanted``.

    Raises:
        InputError: as for ``load``; names the ``kind`` of what is expected.
    """
    content = _content(path)
    names = {name for name in content if name.startswith(_STATE)}
    places = [(_STATE + place, leaf) for place, leaf in _leaves(wanted)]
    if names != {name for name, _ in places}:
        raise InputError(
            f"'{path}' holds the state of another kind of tracker than {kind}; "
            "load it with a tracker made exactly like the saved one."
        )
    leaves = []
    for name, leaf in places:
        value, like = content[name], jax.eval_shape(_data, leaf)
        if (value.shape, value.dtype) != (like.shape, like.dtype):
            remedy = "as many particles and objects as were saved"
            if value.shape == like.shape:
                remedy = "the tracker its precision, jax.config.update('jax_enable_x64', ...)"
            raise InputError(
                f"'{path}' holds the state of another tracker: its {name.removeprefix(_STATE)} is "
                f"{value.dtype} {list(value.shape)}, and this one's {like.dtype} "
                f"{list(like.shape)}; give {remedy}."
            )
        leaves.append(_restored(value, leaf))
    return jax.tree.unflatten(jax.tree.structure(wanted), leaves)


def digest(tree: object) -> str:
    """A digest of a pytree's structure and arrays, for the settings of a job."""
    found = hashlib.sha256(str(jax.tree.structure(tree)).encode())
    for leaf in jax.tree.leaves(tree):
        values = np.asarray(_data(leaf) if isinstance(leaf, jax.Array) else leaf)
        found.update(f"{values.shape}{values.dtype}".encode())
        found.update(np.ascontiguousarray(values).reshape(-1).view(np.uint8).data)
    return DIGEST + found.hexdigest()[:16]


def _content(path: str | os.PathLike[str]) -> dict[str, np.ndarray]:
    with open_arrays(Path(path), "give a file that jaxpf.save wrote") as arrays:
        content, number = dict(arrays), int(arrays[_FORMAT_NAME])
    if number != _FORMAT:
        raise InputError(
            f"'{path}' was saved in format {number}, and this version reads {_FORMAT}; load it "
            "with the version that saved it."
        )
    return content


def _leaves(state: object) -> list[tuple[str, Any]]:
    """Arrays of a state, each with its path in the pytree, such as ``.log_weights``."""
    leaves = jax.tree_util.tree_leaves_with_path(state)
    return [(jax.tree_util.keystr(path), leaf) for path, leaf in leaves]


def _is_key(leaf: Any) -> bool:
    return jax.dtypes.issubdtype(leaf.dtype, jax.dtypes.prng_key)


def _data(leaf: Any) -> Any:
    return jax.random.key_data(leaf) if _is_key(leaf) else leaf


def _restored(value: np.ndarray, leaf: Any) -> jax.Array:
    """Convert a saved array to the type of ``leaf`` (array or random key), known by shape only."""
    if not _is_key(leaf):
        return jnp.asarray(value)
    kinds: list[Any] = []
    jax.eval_shape(lambda key: kinds.append(jax.random.key_impl(key)), leaf)
    return jax.random.wrap_key_data(jnp.asarray(value), impl=kinds[0])


def _plain(leaf: Any) -> np.ndarray:
    return np.asarray(_data(jnp.asarray(leaf)))
