"""Checkpoints: an interrupted job goes on from its folder, to the same results bit for bit."""

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxpf import __version__
from jaxpf.contract.errors import InputError
from jaxpf.files.states import digest, load_like, save
from jaxpf.files.store import Store
from jaxpf.tuning.result import Descent

#: Steps of a scan in a piece.
_LENGTH = 50

Progress = Callable[[int, int], None]


def described(asked: Mapping[str, Any]) -> dict[str, Any]:
    """What determines a job's results, as settings of its store: arrays by a digest."""

    def shown(value: object) -> Any:
        plain = int, float, str, type(None)
        entries = value if isinstance(value, list) else [value]
        return value if all(isinstance(x, plain) for x in entries) else digest(value)

    return {"jaxpf": __version__, **{name: shown(value) for name, value in asked.items()}}


def write(store: Store, description: Mapping[str, Any], descent: Descent) -> None:
    """Write a descent; the first one begins the store's job."""
    if store.settings() is None:
        store.begin(description)
    leaves = enumerate(jax.tree.leaves(vars(descent)))
    store.write(f"repeat-{descent.repeat}", {str(n): np.asarray(leaf) for n, leaf in leaves})


def read(store: Store | None, begun: Descent) -> Descent:
    """The stored descent of a repeat; the one that has just ``begun`` if there is none."""
    name = f"repeat-{begun.repeat}"
    if store is None or not store.names(name):
        return begun
    structure = jax.tree.structure(vars(begun))
    with store.opened(name) as arrays:
        found = jax.tree.unflatten(structure, [arrays[str(n)] for n in range(len(arrays))])
    return Descent(**found | {"repeat": begun.repeat, "stopped": str(found["stopped"])})


class LongScans:
    """The scans of a job, in pieces that report progress and are kept in a folder.

    Args:
        progress: called with the number of steps done, and of all; None reports nothing.
        folder: holds finished pieces, so that the job goes on there; None keeps none.
        total: number of all steps.
        asked: everything that determines the results: by name, values or pytrees of arrays.

    Raises:
        InputError: the folder holds another job.
    """

    def __init__(
        self,
        progress: Progress | None,
        folder: str | os.PathLike[str] | None,
        total: int,
        asked: Mapping[str, Any],
    ):
        self.progress, self.total, self.done = progress, total, 0
        self.store = None if folder is None else Store(Path(folder))
        if self.store is not None:
            self.store.resume(described(asked))

    def scan(
        self, name: str, function: Callable[[Any, Any], Any], carry: Any, items: Any
    ) -> tuple[Any, Any]:
        """Return ``function(carry, items)``, a compiled scan: the last carry, and what is kept."""
        if self.progress is None and self.store is None:
            return function(carry, items)
        kept = []
        for first in range(0, len(jax.tree.leaves(items)[0]), _LENGTH):
            part = jax.tree.map(lambda x, first=first: x[first : first + _LENGTH], items)
            carry, found = self._piece(f"{name}-{first}", function, carry, part)
            kept.append(found)
            self.done += len(jax.tree.leaves(part)[0])
            if self.progress is not None:
                jax.block_until_ready(found)
                self.progress(self.done, self.total)
        return carry, jax.tree.map(lambda *x: jnp.concatenate(x), *kept)

    def _piece(self, name: str, function: Any, carry: Any, items: Any) -> tuple[Any, Any]:
        if self.store is not None and self.store.names(name):
            try:
                wanted = jax.eval_shape(function, carry, items)
                return load_like(self.store.path(name), wanted, "this one")
            except InputError:
                raise InputError(
                    f"'{self.store.path(name)}' is damaged or of another call; remove "
                    f"'{self.store.folder}', or choose another folder."
                ) from None
        result = function(carry, items)
        if self.store is not None:
            save(self.store.path(name), result)
        return result
