"""Text and tables in, with one sentence for each way in which a file cannot be read."""

import csv
from pathlib import Path

from jaxpf.contract.errors import InputError


def read_text(path: Path, what: str, expected: str) -> str:
    """The text of a file; UTF-8, without the mark that spreadsheets put before it.

    Args:
        path: the file.
        what: it holds, such as ``"boxes"``.
        expected: what to give, for messages.

    Raises:
        InputError: no file, no text, or not to be read.
    """
    if path.is_dir():
        raise InputError(f"'{path}' is a folder; give a file of {what}: {expected}")
    try:
        return path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise InputError(f"there is no file of {what} at '{path}'; check the path") from None
    except UnicodeDecodeError:
        raise InputError(f"'{path}' is not a text file; give {expected}") from None
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise InputError(f"cannot read '{path}': {reason}; check its permissions") from error


def read_rows(path: Path, what: str, expected: str) -> list[tuple[int, list[str]]]:
    """Number and fields, stripped, of every line of a CSV file that is not blank.

    Raises:
        InputError: see ``read_text``; or a line that is no CSV.
    """
    reader = csv.reader(read_text(path, what, expected).splitlines(), skipinitialspace=True)
    try:
        rows = [(reader.line_num, [field.strip() for field in row]) for row in reader]
    except csv.Error as error:
        raise InputError(
            f"line {reader.line_num} of '{path}' is no CSV ({error}); correct the line"
        ) from None
    return [(line, fields) for line, fields in rows if any(fields)]
