"""A lock on a folder, so that two programs do not write into it at the same time."""

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path

from jaxpf.errors import InputError
from jaxpf.files.writing import report_os_errors

LOCK = ".lock"


@contextlib.contextmanager
def locked(folder: Path, doing: str, *, keep: bool = True) -> Iterator[None]:
    """Keep other processes from writing into the same folder at the same time.

    The system drops the lock when the process ends, however it ends.  Where there are no such
    locks nothing is kept.

    Args:
        folder: is created.
        doing: what messages say of the other process, such as "evaluating".
        keep: leave the lock's file behind, for the next process.

    Raises:
        InputError: another process holds the folder, or it cannot be written.
    """
    path = folder / LOCK
    while True:
        with report_os_errors("write into the folder", folder):
            folder.mkdir(parents=True, exist_ok=True)
            file = open(path, "w")  # noqa: SIM115 - held open while the lock is
        with file:
            try:
                import fcntl

                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise InputError(
                    f"another process is {doing} into '{folder}'; wait for it, or choose another "
                    "output folder."
                ) from None
            except (ImportError, OSError):
                pass
            if not _is_same(file.fileno(), path):
                continue  # whoever held the lock until now has removed its file
            try:
                yield
            finally:
                if not keep:
                    with contextlib.suppress(OSError):
                        path.unlink()
            return


def _is_same(descriptor: int, path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(descriptor), os.stat(path))
    except OSError:
        return False
