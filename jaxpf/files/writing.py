"""Output folders and files that are either complete or absent."""

import csv
import io
import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any, Self

from jaxpf.contract.errors import InputError


@contextmanager
def report_os_errors(action: str, path: str | os.PathLike[str]) -> Iterator[None]:
    """Turn an ``OSError`` within the block into an ``InputError`` that names ``path``.

    Args:
        action: what was tried, as a verb phrase: ``"write"``, ``"create the folder"``.
        path: the file or folder concerned.
    """
    try:
        yield
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise InputError(
            f"cannot {action} '{path}': {reason}; check the path, its permissions and the free "
            "space, or choose another place"
        ) from error


#: In the names of files that are not complete.
PARTIAL = ".partial"
#: A folder's lock, see ``jaxpf.files.locking``.
LOCK = ".lock"


def temporary_sibling(path: Path) -> Path:
    """A hidden name in the folder of ``path``, with its suffix and the process id.

    Only a rename within one folder is atomic, hence the same folder; libraries that choose
    a format by the suffix see the right one; two processes never share a name.
    """
    return path.with_name(f".{path.stem}.{os.getpid()}{PARTIAL}{path.suffix}")


@contextmanager
def atomic_path(path: Path) -> Iterator[Path]:
    """A name to write to, of a file that appears at ``path`` only once the block ends well.

    For libraries that open their files themselves; see ``atomic_write``.

    Raises:
        InputError: the file cannot be written.
    """
    temporary = temporary_sibling(path)
    try:
        with report_os_errors("write", path):
            yield temporary
            os.replace(temporary, path)
    finally:
        with suppress(OSError):  # gone already, or never there
            temporary.unlink()


@contextmanager
def atomic_write(
    path: str | os.PathLike[str], mode: str = "w", encoding: str | None = "utf-8"
) -> Iterator[IO[Any]]:
    """Open a file that appears under its name only once it is complete.

    The text goes to a temporary file in the same folder, which is flushed to disk and
    renamed at the end of the block.  If the block raises, whatever was at ``path`` stays as
    it was and the temporary file is removed.

    Args:
        path: the file to write or replace; its folder must exist.
        mode: ``"w"`` or ``"wb"``.
        encoding: of text; ignored with ``"wb"``.

    Yields:
        The open file.

    Raises:
        InputError: the file cannot be written (no such folder, no permission, disk full).
    """
    if mode not in ("w", "wb"):
        raise ValueError(f"mode is 'w' or 'wb', not {mode!r}")
    path = Path(path)
    text = mode == "w"
    # newline="" keeps "\n" on every platform: the same run gives the same bytes.
    options: dict[str, Any] = {"encoding": encoding, "newline": ""} if text else {}
    with atomic_path(path) as temporary, open(temporary, mode, **options) as file:
        yield file
        file.flush()
        os.fsync(file.fileno())


def write_text(path: str | os.PathLike[str], text: str) -> None:
    """Write a text, completely or not at all; errors as for ``atomic_write``."""
    with atomic_write(path) as file:
        file.write(text)


def csv_text(rows: Iterable[Iterable[Any]]) -> str:
    """Rows as lines of CSV."""
    buffer = io.StringIO()
    csv.writer(buffer, lineterminator="\n").writerows(rows)
    return buffer.getvalue()


class LineWriter:
    """Append whole lines to a file that has its final name from the start.

    After every call the file holds whole lines only: nothing is lost when the program is
    interrupted or killed.  Use it as a context manager.

    Attributes:
        path: the file.
        header: its first line, or "" for none.
    """

    header: str = ""

    def __init__(self, path: str | os.PathLike[str]):
        """Create or empty the file, and write its header.

        Raises:
            InputError: it cannot be written.
        """
        self.path = Path(path)
        with report_os_errors("write", self.path):
            # Unbuffered: one call is one call to the operating system.
            self._file = open(self.path, "wb", buffering=0)  # noqa: SIM115
        self._end = 0
        if self.header:
            self.write_lines(f"{self.header}\n")

    def write_rows(self, rows: Iterable[Iterable[Any]]) -> None:
        """Append lines of CSV, all of them or none.

        Raises:
            InputError: see ``write_lines``.
        """
        self.write_lines(csv_text(rows))

    def write_lines(self, text: str) -> None:
        """Append lines, all of them or none.

        Raises:
            InputError: the disk is full or the file cannot be written.
        """
        data = text.encode("utf-8")
        with report_os_errors("write", self.path):
            try:
                written = 0
                while written < len(data):
                    written += self._file.write(data[written:]) or 0
            except BaseException:
                self._file.truncate(self._end)
                self._file.seek(self._end)
                raise
        self._end += len(data)

    def close(self) -> None:
        """Close the file; further calls do nothing."""
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()


def check_output_file(path: str | os.PathLike[str], flag: str = "--output") -> None:
    """Find out now, rather than after the work, whether a file can be written; ``flag`` names it.

    Raises:
        InputError: it is no file that may be replaced, or its folder is missing or cannot be
            written.
    """
    path = Path(path)
    if path.exists() and not path.is_file():
        what = "a folder" if path.is_dir() else "a device or a pipe"
        raise InputError(f"output file '{path}' is {what}; choose another {flag}")
    probe = temporary_sibling(path)
    with report_os_errors("write", path):
        probe.touch()
        probe.unlink()


def _is_left_over(name: str) -> bool:
    """Whether a program that was killed left a file of that name: its lock, or half a file."""
    return name == LOCK or (name.startswith(".") and PARTIAL in name)


def prepare_output_folder(path: str | os.PathLike[str], overwrite: bool = False) -> Path:
    """Create the folder for a run's results, or refuse to mix them with other files.

    With ``overwrite`` nothing is deleted: files of the same names are replaced as the run
    writes them, others stay.

    Args:
        path: the folder; parents are created too.
        overwrite: accept a folder that is not empty.

    Returns:
        The folder.

    Raises:
        InputError: it is a file, it is not empty, or it cannot be created or written.
    """
    path = Path(path)
    with report_os_errors("create the output folder", path):
        is_file = path.exists() and not path.is_dir()
    if is_file:
        raise InputError(
            f"output folder '{path}' is a file; choose another folder or remove the file"
        )
    with report_os_errors("create the output folder", path):
        path.mkdir(parents=True, exist_ok=True)
        names = sorted(entry.name for entry in path.iterdir())
        first = next((name for name in names if not _is_left_over(name)), None)
    if first is not None and not overwrite:
        raise InputError(
            f"output folder '{path}' is not empty (it holds '{first}'); choose another folder "
            "or add --overwrite"
        )
    # Found out now rather than after an hour of tracking; permission bits alone do not tell
    # (read-only mounts, quotas).
    with report_os_errors("write into the output folder", path):
        probe = path / f".write-test.{os.getpid()}"
        probe.touch()
        probe.unlink()
    return path
