"""Text and tables in, with one sentence for each way in which a file cannot be read."""

import csv
import math
import re
from pathlib import Path

from jaxpf.contract.errors import InputError

_DECIMAL_COMMA = re.compile(r"[+-]?\d+,\d+")


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


def separator_of(text: str) -> str:
    """What separates the fields of a table: ``;`` if its first line holds one, else ``,``."""
    first = next((line for line in text.splitlines() if line.strip()), "")
    return ";" if ";" in first else ","


def parse_number(field: str, place: str, remedy: str) -> float:
    """The finite number in a field.

    Args:
        field: its text, such as ``"1"``, ``"1.0"`` or ``"1e2"``.
        place: where it stands and what it is, for messages: ``"line 3 of 'a.csv' has x"``.
        remedy: what to give instead.

    Raises:
        InputError: it is not a finite number; one with a decimal comma is named as such.
    """
    try:
        value = float(field)
    except ValueError:
        value = math.nan
    if math.isfinite(value):
        return value
    if _DECIMAL_COMMA.fullmatch(field):
        remedy = f"write decimals with a point, {field.replace(',', '.')}"
    raise InputError(f"{place} '{field[:40]}', which is not a finite number; {remedy}")


def read_rows(path: Path, what: str, expected: str) -> list[tuple[int, list[str]]]:
    """Number and fields, stripped, of every line of a CSV file that is not blank.

    Raises:
        InputError: see ``read_text``; or a line that is no CSV.
    """
    text = read_text(path, what, expected)
    lines, separator = text.splitlines(), separator_of(text)
    reader = csv.reader(lines, delimiter=separator, skipinitialspace=True)
    try:
        rows = [(reader.line_num, [field.strip() for field in row]) for row in reader]
    except csv.Error as error:
        raise InputError(
            f"line {reader.line_num} of '{path}' is no CSV ({error}); correct the line"
        ) from None
    return [(line, fields) for line, fields in rows if any(fields)]
