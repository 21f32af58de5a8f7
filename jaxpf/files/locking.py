"""A lock on a folder, so that two programs do not write into it at the same time."""

import contextlib
import errno
from collections.abc import Iterator
from pathlib import Path

from jaxpf.contract.errors import InputError
from jaxpf.files.writing import LOCK as LOCK, remove_leavings, report_os_errors

#: Seconds to retry: acquiring fails briefly while another process removes the lock's file.
_PATIENCE = 0.1
#: Errors of file systems that do not support locks; there, folders are not locked.
_NO_LOCKS = (errno.ENOLCK, errno.EOPNOTSUPP)


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
