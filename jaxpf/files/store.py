"""Work that goes on after a stop: what was asked, and what came of it so far, piece by piece.

Evaluations keep their batches of runs so, papers their parts, tuning its descents.
"""

import contextlib
import json
import shutil
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from jaxpf.contract.errors import InputError
from jaxpf.contract.options import plain
from jaxpf.files.writing import PARTIAL, atomic_write, report_os_errors, write_text

SETTINGS = "settings.json"
#: The array of a piece that holds what is said of it, as JSON.
_ABOUT = "about"


class Damaged(InputError):
    """A piece that is missing, cut off or altered."""


class Store:
    """Pieces by name, each a file of arrays that is complete or absent, in one folder.

    Attributes:
        folder: of the pieces, ``NAME.npz``, and of ``settings.json``.
        remedy: what to do about a damaged piece, for messages.
    """

    def __init__(self, folder: Path, remedy: str = "choose another folder"):
        self.folder = folder
        self.remedy = remedy

    def settings(self) -> Any:
        """What was asked, as ``begin`` wrote it; None where nothing was begun.

        Raises:
            InputError: the file cannot be read.
        """
        path = self.folder / SETTINGS
        try:
            return json.loads(path.read_text(encoding="utf-8"))
        except FileNotFoundError:
            return None
        except (OSError, ValueError, RecursionError) as error:
            raise InputError(f"'{path}' cannot be read ({error}); {self.remedy}.") from None

    def begin(self, settings: Mapping[str, Any]) -> None:
        """Create the folder, and write what is asked, fit for JSON.

        Raises:
            InputError: it cannot be written.
        """
        with report_os_errors("create the folder", self.folder):
            self.folder.mkdir(parents=True, exist_ok=True)
        write_text(self.folder / SETTINGS, json.dumps(settings, indent=1))

    def path(self, name: str) -> Path:
        """The file of a piece."""
        return self.folder / f"{name}.npz"

    def write(self, name: str, arrays: Mapping[str, Any], about: Any = None) -> Path:
        """Write a piece; its file appears only once it is complete.

        Args:
            name: fit for a file.
            arrays: by name.
            about: what else is to be known of it, fit for JSON.

        Raises:
            InputError: it cannot be written, because the disk is full for example.
        """
        said = {} if about is None else {_ABOUT: np.array(json.dumps(about))}
        with atomic_write(self.path(name), "wb") as file:
            np.savez(file, allow_pickle=False, **said, **arrays)
        return self.path(name)

    @contextlib.contextmanager
    def opened(self, name: str) -> Iterator[Mapping[str, np.ndarray]]:
        """The arrays of a piece, read as they are asked for, with checksums.

        Raises:
            Damaged: the file is missing or damaged, or within the block an array is.
        """
        path = self.path(name)
        try:
            with np.load(path, allow_pickle=False) as content:
                yield content
        except Exception as error:  # there is no end to what a damaged archive raises
            cause = " ".join(str(error).split())[:100]
            raise Damaged(f"'{path}' is damaged ({cause}); {self.remedy}.") from None

    def read(self, name: str) -> dict[str, np.ndarray]:
        """All arrays of a piece; errors as for ``opened``."""
        with self.opened(name) as content:
            return {key: content[key] for key in content}

    def remove_leavings(self) -> None:
        """Remove what a killed process left half-written."""
        for path in self.folder.glob(f".*{PARTIAL}*"):
            with contextlib.suppress(OSError):
                path.unlink()

    def remove(self) -> None:
        """Remove the folder with all pieces, if it is there."""
        shutil.rmtree(self.folder, ignore_errors=True)


def about(arrays: Mapping[str, np.ndarray]) -> Any:
    """What ``Store.write`` was told about a piece; to be asked within ``Store.opened``."""
    return json.loads(str(arrays[_ABOUT]))


def differences(old: Mapping[str, Any], new: Mapping[str, Any]) -> Iterable[str]:
    """What changed between two descriptions of what is asked, as "name = old, now new"."""
    for name in dict.fromkeys([*old, *new]):
        before, after = old.get(name), new.get(name)
        if before == after:
            continue
        if isinstance(before, Mapping) and isinstance(after, Mapping):
            yield from (f"{name}: {change}" for change in differences(before, after))
        else:
            yield f"{name} = {plain(before)}, now {plain(after)}"
