"""A lock on a folder, so that two programs do not write into it at the same time."""

import contextlib
import errno
from collections.abc import Iterator
from pathlib import Path

from jaxpf.contract.errors import InputError
from jaxpf.files.writing import LOCK as LOCK, report_os_errors

#: Seconds in which a lock that was just given back, and its file removed, is had in spite of it.
_PATIENCE = 0.1
#: What file systems without locks answer: there nothing is kept.
_NO_LOCKS = (errno.ENOLCK, errno.EOPNOTSUPP)


@contextlib.contextmanager
def locked(folder: Path, doing: str, *, keep: bool = True) -> Iterator[None]:
    """Keep other processes from writing into the same folder at the same time.

    The system drops the lock when the process ends, however it ends.

    Args:
        folder: is created.
        doing: what messages say of the other process, such as "evaluating".
        keep: leave the lock's file behind, for the next process.

    Raises:
        InputError: another process holds the folder, or it cannot be written.
    """
    from filelock import FileLock, Timeout

    with report_os_errors("write into the folder", folder):
        folder.mkdir(parents=True, exist_ok=True)
        # Each call has a lock of its own: also two threads of a process keep each other out.
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
        yield
    finally:
        if not keep:
            # Before it is given back, or it might be another process's already.
            with contextlib.suppress(OSError):
                (folder / LOCK).unlink()
        lock.release()
