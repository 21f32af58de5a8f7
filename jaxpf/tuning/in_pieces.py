"""Long scans in pieces: they report progress, and resume from a folder after an interruption.

The pieces' results are those of one scan, bit for bit.
"""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp

from jaxpf import __version__
from jaxpf.contract.errors import InputError, check_path
from jaxpf.contract.pytree import is_concrete
from jaxpf.files.states import digest, load_like, save
from jaxpf.files.store import Store

#: Steps of a scan in a piece.
_LENGTH = 50

Progress = Callable[[int, int], None]


class LongScans:
    """One or several scans of a job.

    Attributes:
        progress: called with the number of steps done, and of all.
        total: number of all steps.
        store: of finished pieces; None keeps none.
        done: number of steps done.
    """

    def __init__(
        self,
        progress: Progress | None,
        folder: str | os.PathLike[str] | None,
        total: int,
        asked: dict[str, Any],
    ):
        """Begin the job, or go on with that of the folder.

        Args:
            progress: see the class; None reports nothing.
            folder: holds finished pieces; None computes in one piece, if nothing is reported.
            total: number of all steps.
            asked: everything that determines the results: by name, values or pytrees of arrays.

        Raises:
            InputError: ``progress`` is no function, the call is traced, or the folder holds another
                job.
        """
        if progress is not None and not callable(progress):
            raise InputError(f"progress={progress!r:.60} must be a function of (done, total).")
        if not (progress is None and folder is None) and not is_concrete(*asked.values()):
            raise InputError("progress and folder need known values; call outside of jit.")
        self.progress, self.total, self.done = progress, total, 0
        self.store: Store | None = None
        if folder is not None:
            self.store = Store(Path(check_path("folder", folder)))
            settings = {"jaxpf": __version__} | {name: _shown(x) for name, x in asked.items()}
            old = self.store.settings()
            if old is None:
                self.store.begin(settings)
            else:
                self.store.check_same(old, settings)

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
        if path.exists():
            try:
                return load_like(path, jax.eval_shape(function, carry, items), "this one")
            except InputError:
                raise InputError(
                    f"'{path}' is damaged or of another call; remove '{self.store.folder}', or "
                    "choose another folder."
                ) from None
        result = function(carry, items)
        save(path, result)
        return result


def _shown(value: object) -> Any:
    """Plain values as they are, arrays and random keys by a digest."""
    return value if isinstance(value, int | float | str | None) else digest(value)
