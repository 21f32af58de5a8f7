"""Long scans in pieces: they report progress, and resume from a folder after an interruption.

The pieces' results are those of one scan, bit for bit.
"""

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp

from jaxpf import __version__
from jaxpf.contract.errors import InputError
from jaxpf.files.states import digest, load_like, save
from jaxpf.files.store import Store

#: Steps of a scan in a piece.
_LENGTH = 50

Progress = Callable[[int, int], None]


class LongScans:
    """One or several scans of a job.

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
            shown = {name: _shown(x) for name, x in asked.items()}
            self.store.resume({"jaxpf": __version__, **shown})

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
        if self.store is None:
            return function(carry, items)
        path = self.store.path(name)
        if not path.exists():
            result = function(carry, items)
            save(path, result)
            return result
        try:
            return load_like(path, jax.eval_shape(function, carry, items), "this one")
        except InputError:
            raise InputError(
                f"'{path}' is damaged or of another call; remove '{self.store.folder}', or choose "
                "another folder."
            ) from None


def _shown(value: object) -> Any:
    """Plain values as they are, arrays and random keys by a digest."""
    return value if isinstance(value, int | float | str | None) else digest(value)
