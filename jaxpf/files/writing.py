"""Writes output folders and files that are either complete or absent."""

import csv
import glob
import io
import os
import secrets
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any, Self

from jaxpf.contract.errors import InputError


@contextmanager
def report_os_errors(action: str, path: str | os.PathLike[str]) -> Iterator[None]:
    """Turn an ``OSError`` into an ``InputError``: "cannot ``action`` the ``path``", and why."""
    try:
        yield
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise InputError(
            f"cannot {action} '{path}': {reason}; check the path, its permissions and the free "
            "space, or choose another place"
        ) from error


#: What a run of ``jaxpf track`` says about itself.
SUMMARY = "summary.json"
#: Part of the names of incomplete files.
PARTIAL = ".partial"
#: Name of a folder's lock file, see ``jaxpf.files.store``.
LOCK = ".lock"


def temporary_sibling(path: Path) -> Path:
    """Return a new hidden name in the folder of ``path``, with its suffix.

    The same folder, because a rename is atomic only within one folder; the same suffix, because
    some libraries choose the format by it; random letters, because processes and threads may write
    the same file at once.  ``tempfile`` would create the file, readable by its owner alone.
    """
    return path.with_name(f".{path.stem}.{secrets.token_hex(4)}{PARTIAL}{path.suffix}")


@contextmanager
def atomic_path(path: Path) -> Iterator[Path]:
    """Yield a temporary name; the file is renamed to ``path`` if the block succeeds.

    For libraries that open files themselves; see ``atomic_write``.
    """
    if not path.name:
        raise InputError(f"'{path}' names no file to write; give the path of a file.")
    temporary = temporary_sibling(path)
    try:
        with report_os_errors("write", path):
            yield temporary
            os.replace(temporary, path)
    finally:
        with suppress(OSError):  # already renamed, or never created
            temporary.unlink()


@contextmanager
def atomic_write(path: str | os.PathLike[str], mode: str = "w") -> Iterator[IO[Any]]:
    """Open a file that appears under its name only once it is complete.

    The content goes to a temporary file in the same folder, which is flushed to disk and
    renamed at the end of the block.  If the block raises, the file at ``path`` stays unchanged
    and the temporary file is removed.
    """
    path = Path(path)
    text = mode == "w"
    # newline="" keeps "\n" on every platform: the same run writes the same bytes.
    options: dict[str, Any] = {"encoding": "utf-8", "newline": ""} if text else {}
    with atomic_path(path) as temporary, open(temporary, mode, **options) as file:
        yield file
        file.flush()
        os.fsync(file.fileno())


def write_text(path: str | os.PathLike[str], text: str) -> None:
    """Write a text file, completely or not at all; errors as for ``atomic_write``."""
    with atomic_write(path) as file:
        file.write(text)


def csv_text(rows: Iterable[Iterable[object]]) -> str:
    """Format rows as CSV lines; ``jaxpf.files.reading.read_rows`` reads the same texts."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerows(rows)
    return buffer.getvalue()


class LineWriter:
    """Appends whole lines to a file that has its final name from the start.

    After every call the file holds whole lines only, so an interrupted or killed program loses
    nothing.  Use it as a context manager.

    Attributes:
        path: the file.
        header: its first line, or "" for none.
    """

    header: str = ""

    def __init__(self, path: str | os.PathLike[str]):
        """Create or empty the file and write its header."""
        self.path = Path(path)
        with report_os_errors("write", self.path):
            # Unbuffered: each write is one system call.
            self._file = open(self.path, "wb", buffering=0)  # noqa: SIM115
        self._end = 0
        if self.header:
            self.write_lines(f"{self.header}\n")

    def write_rows(self, rows: Iterable[Iterable[object]]) -> None:
        """Append CSV lines, all of them or none; errors as for ``write_lines``."""
        self.write_lines(csv_text(rows))

    def write_lines(self, text: str) -> None:
        """Append lines, all of them or none."""
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


def check_output_file(
    path: str | os.PathLike[str], flag: str = "--output", overwrite: bool = False
) -> None:
    """Check before the work whether a file can be written; ``flag`` names it in messages."""
    path = Path(path)
    if path.is_file() and not overwrite:
        raise InputError(f"output file '{path}' exists; choose another {flag} or add --overwrite")
    if path.exists() and not path.is_file():
        what = "a folder" if path.is_dir() else "a device or a pipe"
        raise InputError(f"output file '{path}' is {what}; choose another {flag}")
    with report_os_errors("write", path):
        _probe(path)


def _probe(path: Path) -> None:
    """Write a file beside ``path``, and remove it."""
    probe = temporary_sibling(path)
    probe.touch()
    probe.unlink()


def remove_leavings(folder: Path, stem: str = "") -> None:
    """Remove the incomplete files of killed processes, of names that begin with ``stem``."""
    for path in folder.glob(f".{glob.escape(stem)}*{PARTIAL}*"):
        with suppress(OSError):
            path.unlink()


def is_left_over(path: Path) -> bool:
    """Whether a killed program left it: its lock, an incomplete file, or a folder of only those."""
    if path.is_dir():
        return all(map(is_left_over, path.iterdir()))
    return path.name == LOCK or (path.name.startswith(".") and PARTIAL in path.name)


def check_output_folder(path: Path) -> None:
    """Refuse, before the work, a folder that cannot be: its name is too long, or below a file."""
    # Path.exists hides such errors from Python 3.14 on.
    with report_os_errors("create the output folder", path), suppress(FileNotFoundError):
        path.stat()


def prepare_output_folder(path: str | os.PathLike[str], overwrite: bool = False) -> Path:
    """Create the folder for a run's results; refuse to mix them with other files.

    ``overwrite`` accepts a folder that is not empty and deletes nothing: the run replaces files of
    the same names, others stay.
    """
    path = Path(path)
    with report_os_errors("create the output folder", path):
        if path.exists() and not path.is_dir():
            raise InputError(
                f"output folder '{path}' is a file; choose another folder or remove the file"
            )
        path.mkdir(parents=True, exist_ok=True)
        first = next((each.name for each in sorted(path.iterdir()) if not is_left_over(each)), None)
    if first is not None and not overwrite:
        raise InputError(
            f"output folder '{path}' is not empty (it holds '{first}'); choose another folder "
            "or add --overwrite"
        )
    # Test now rather than after an hour of tracking; permission bits miss read-only mounts and
    # quotas.
    with report_os_errors("write into the output folder", path):
        _probe(path / ".write-test")
    return path
