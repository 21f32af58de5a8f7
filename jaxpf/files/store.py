"""The store of long jobs: finished pieces in a folder, each complete or absent.

A job that was interrupted makes only the pieces that it does not find.  Evaluations keep batches
of runs, papers parts of experiments, tuning its descents and long scans::

    store = Store(folder)
    store.resume({"seed": 0})  # begins the job, or refuses a folder with another one
    for name, arrays in store.made(((f"part-{n}", n) for n in range(9)), measure, pool):
        ...  # read if stored, else measure(n), stored

The folder holds ``settings.json``, everything that determines the pieces, and ``NAME.npz``.
"""

import contextlib
import errno
import importlib.metadata
import json
import platform
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from jaxpf.contract.errors import InputError
from jaxpf.contract.numbers import plain
from jaxpf.files.executors import Pool, in_turn
from jaxpf.files.writing import LOCK, atomic_write, remove_leavings, report_os_errors, write_text

SETTINGS = "settings.json"
#: Packages that results depend on.
_PACKAGES = ("jaxpf", "jax", "jaxlib", "optax", "chex", "numpy", "opencv-python-headless")
#: How the digest of arrays in settings begins, see ``jaxpf.files.states.digest``.
DIGEST = "sha256:"
#: Seconds to retry: acquiring fails briefly while another process removes the lock's file.
_PATIENCE = 0.1
#: Errors of file systems that do not support locks; there, folders are not locked.
_NO_LOCKS = (errno.ENOLCK, errno.EOPNOTSUPP)


class Damaged(InputError):
    """A piece is missing, truncated or altered."""


class Store:
    """The settings of a job in one folder, and its finished pieces by name.

    Attributes:
        folder: holds ``settings.json`` and the pieces, ``NAME.npz``.
        remedy: what to do about damage, for messages.
    """

    def __init__(self, folder: Path, remedy: str = "choose another folder"):
        self.folder = folder
        self.remedy = remedy

    def settings(self) -> Any:
        """The settings of the job that was begun here, or None."""
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

    def resume(self, settings: Mapping[str, object]) -> None:
        """Begin the job, or go on with it; refuse a folder in which another job was begun."""
        old = self.settings()
        if old is None:
            self.begin(settings)
        else:
            self.check_same(old, settings)

    def check_same(self, old: Mapping[str, object], new: Mapping[str, object]) -> None:
        """Refuse settings that differ from those of the job begun here."""
        for change in differences(old, new):
            raise InputError(
                f"'{self.folder}' was begun with {change}; choose another folder, or repeat the "
                "same call."
            )

    def made(
        self,
        pieces: Iterable[tuple[str, Any]],
        make: Callable[[Any], Mapping[str, np.ndarray]],
        pool: Pool | None = None,
    ) -> Iterator[tuple[str, Mapping[str, np.ndarray]]]:
        """Yield name and arrays of every piece: read if it is stored, else made and stored.

        A piece has a name, valid as a file name, and what ``make`` is called with.  Workers of a
        ``pool`` make pieces in any order, see ``in_turn``.
        """
        missing = {}
        for name, piece in pieces:
            try:
                yield name, self.read(name)
            except Damaged:
                missing[name] = piece
        for name, arrays in in_turn(make, missing, pool):
            self.write(name, arrays)
            yield name, arrays

    def path(self, name: str) -> Path:
        """Path of a piece."""
        return self.folder / f"{name}.npz"

    def names(self, pattern: str = "*") -> list[str]:
        """Names of the stored pieces that match a pattern, in alphabetical order."""
        found = (path.stem for path in self.folder.glob(f"{pattern}.npz"))
        return sorted(name for name in found if not name.startswith("."))

    def write(self, name: str, arrays: Mapping[str, ArrayLike]) -> Path:
        """Write a piece, whose name is valid as a file name, and return its path."""
        write_arrays(self.path(name), arrays)
        return self.path(name)

    def read(self, name: str, *fields: str) -> dict[str, np.ndarray]:
        """The arrays of a piece, or those named; errors as for ``opened``."""
        with self.opened(name) as arrays:
            return {field: arrays[field] for field in fields or arrays}

    def opened(self, name: str) -> AbstractContextManager[Mapping[str, np.ndarray]]:
        """Open a piece; see ``open_arrays``."""
        return open_arrays(self.path(name), self.remedy)

    def remove(self) -> None:
        """Remove the folder with all pieces, if it exists."""
        shutil.rmtree(self.folder, ignore_errors=True)


def write_arrays(path: Path, arrays: Mapping[str, ArrayLike]) -> None:
    """Write arrays by name into a file, which appears only once it is complete."""
    with atomic_write(path, "wb") as file:
        np.savez(file, allow_pickle=False, **arrays)


@contextlib.contextmanager
def open_arrays(path: Path, remedy: str) -> Iterator[Mapping[str, np.ndarray]]:
    """Open a file that ``write_arrays`` wrote; its arrays are read on access, with checksums.

    Raises:
        Damaged: the file is missing or damaged; any other error in the block counts as damage.
    """
    try:
        with np.load(path, allow_pickle=False) as content:
            yield content
    except Exception as error:  # a damaged archive can raise almost anything
        if isinstance(error, OSError) and error.strerror:
            why = f"cannot be read: {error.strerror.lower()}"
        else:
            why = "is damaged, or was not written by jaxpf"
        raise Damaged(f"'{path}' {why}; {remedy}.") from None


def versions() -> dict[str, str]:
    """Versions of Python, the platform and the packages that results depend on."""
    by_name = {"python": platform.python_version(), "platform": platform.platform()}
    for package in _PACKAGES:
        try:
            by_name[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            by_name[package] = "unknown"
    return by_name


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


@contextlib.contextmanager
def locked(folder: Path, doing: str, *, keep: bool = True) -> Iterator[None]:
    """Lock a folder, so that no other process or thread writes into it at the same time.

    Incomplete files that killed processes left there are removed.
    The system releases the lock when the process ends, even after a crash.

    Args:
        folder: created if missing.
        doing: what the other process does, for messages, such as "evaluating".
        keep: leave the lock's file behind for the next process.
    """
    from filelock import FileLock, Timeout

    with report_os_errors("write into the folder", folder):
        folder.mkdir(parents=True, exist_ok=True)
        # Each call creates its own lock object, so that threads of one process exclude each other.
        lock = FileLock(folder / LOCK, timeout=_PATIENCE, poll_interval=_PATIENCE / 5)
        try:
            lock.acquire()
        except Timeout:
            raise InputError(
                f"another process is {doing} into '{folder}'; wait for it, or choose another "
                "output folder."
            ) from None
        except OSError as error:
            if error.errno not in _NO_LOCKS:
                raise
    try:
        remove_leavings(folder)
        yield
    finally:
        if not keep:
            # Before the release: afterwards the file may already belong to another process.
            with contextlib.suppress(OSError):
                (folder / LOCK).unlink()
        lock.release()


def is_locked(folder: Path) -> bool:
    """Whether another process or thread is writing into a folder."""
    from filelock import FileLock, Timeout

    if not (folder / LOCK).is_file():
        return False
    try:
        with FileLock(folder / LOCK, timeout=0):
            return False
    except Timeout:
        return True
    except OSError:  # not ours to lock, or no locks there
        return False
