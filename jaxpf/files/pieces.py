"""Pieces of a long job, each a file of arrays that exists only once it is complete.

A job that was interrupted computes only the pieces that it does not find.  Evaluations keep batches
of runs, papers parts of experiments, tuning its descents.
"""

import contextlib
import json
import shutil
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jaxpf.contract.errors import InputError
from jaxpf.contract.options import plain
from jaxpf.files.writing import atomic_write, report_os_errors, write_text

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

SETTINGS = "settings.json"
#: How the digest of arrays in settings begins, see ``jaxpf.files.states.digest``.
DIGEST = "sha256:"


class Damaged(InputError):
    """A piece is missing, truncated or altered."""


class Pieces:
    """The settings of a job in one folder, and its finished pieces by name.

    Attributes:
        folder: holds the pieces, ``NAME.npz``, and ``settings.json``.
        remedy: what to do about a damaged piece, for messages.
    """

    def __init__(self, folder: Path, remedy: str = "choose another folder"):
        self.folder = folder
        self.remedy = remedy

    def settings(self) -> Any:
        """Return the settings that ``begin`` wrote, or None if no job was begun."""
        path = self.folder / SETTINGS
        try:
            return json.loads(path.read_text(encoding="utf-8"))
        except FileNotFoundError:
            return None
        except (OSError, ValueError, RecursionError) as error:
            raise InputError(f"'{path}' cannot be read ({error}); {self.remedy}.") from None

    def begin(self, settings: Mapping[str, object]) -> None:
        """Create the folder and write the settings, which must be JSON-serialisable."""
        with report_os_errors("create the folder", self.folder):
            self.folder.mkdir(parents=True, exist_ok=True)
        write_text(self.folder / SETTINGS, json.dumps(settings, indent=1))

    def check_same(self, old: Mapping[str, object], new: Mapping[str, object]) -> None:
        """Refuse a job that differs from the one begun in the folder."""
        for change in differences(old, new):
            raise InputError(
                f"'{self.folder}' was begun with {change}; choose another folder, or repeat the "
                "same call."
            )

    def path(self, name: str) -> Path:
        """Return the path of a piece."""
        return self.folder / f"{name}.npz"

    def write(self, name: str, arrays: "Mapping[str, ArrayLike]") -> Path:
        """Write a piece, whose name is valid as a file name, and return its path."""
        with atomic_write(self.path(name), "wb") as file:
            np.savez(file, allow_pickle=False, **arrays)
        return self.path(name)

    @contextlib.contextmanager
    def opened(self, name: str) -> Iterator[Mapping[str, np.ndarray]]:
        """Open a piece; its arrays are read on access, with checksums.

        Raises:
            Damaged: the file is missing or damaged; an array read in the block may raise it, too.
        """
        path = self.path(name)
        try:
            with np.load(path, allow_pickle=False) as content:
                yield content
        except Exception as error:  # a damaged archive can raise almost anything
            cause = " ".join(str(error).split())[:100]
            raise Damaged(f"'{path}' is damaged ({cause}); {self.remedy}.") from None

    def remove(self) -> None:
        """Remove the folder with all pieces, if it exists."""
        shutil.rmtree(self.folder, ignore_errors=True)


def differences(old: Mapping[str, object], new: Mapping[str, object]) -> Iterable[str]:
    """Yield the differences between two settings, as "name = old, now new"."""
    for name in dict.fromkeys([*old, *new]):
        before, after = old.get(name), new.get(name)
        if before == after:
            continue
        if isinstance(before, Mapping) and isinstance(after, Mapping):
            yield from (f"{name}: {change}" for change in differences(before, after))
        elif DIGEST in f"{before}{after}":
            yield f"another value of {name}"
        else:
            yield f"{name} = {plain(before)}, now {plain(after)}"
