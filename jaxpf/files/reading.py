"""Text and tables in, with one sentence for each way in which a file cannot be read."""

import codecs
import csv
import math
import re
from pathlib import Path

from jaxpf.contract.errors import InputError

_DECIMAL_COMMA = re.compile(r"[+-]?\d+,\d+")


def read_text(path: Path, what: str, expected: str) -> str:
    """The text of a file: UTF-8 with or without its mark, or UTF-16 with it.

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
        content = path.read_bytes()
        is_utf_16 = content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
        return content.decode("utf-16" if is_utf_16 else "utf-8-sig")
    except FileNotFoundError:
        raise InputError(f"there is no file of {what} at '{path}'; check the path") from None
    except UnicodeDecodeError:
        raise InputError(f"'{path}' is not a text file; give {expected}") from None
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise InputError(f"cannot read '{path}': {reason}; check its permissions") from error


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
        value = math.nan if "_" in field else float(field)  # Python alone writes 1_000
    except ValueError:
        value = math.nan
    if math.isfinite(value):
        return value
    if _DECIMAL_COMMA.fullmatch(field):
        remedy = f"write decimals with a point, {field.replace(',', '.')}"
    raise InputError(f"{place} '{field[:40]}', which is not a finite number; {remedy}")


def read_rows(path: Path, what: str, expected: str) -> list[tuple[int, list[str]]]:
    """Number and stripped fields of every line of a table that is not blank.

    Commas separate the fields, or the semicolons or tabs of the first line.

    Raises:
        InputError: see ``read_text``; or a line that is no CSV.
    """
    lines = read_text(path, what, expected).splitlines()
    first = next((line.strip() for line in lines if line.strip()), "")
    separator = next((mark for mark in ";\t" if mark in first), ",")
    reader = csv.reader(lines, delimiter=separator, skipinitialspace=True)
    try:
        rows = [(reader.line_num, [field.strip() for field in row]) for row in reader]
    except csv.Error as error:
        raise InputError(
            f"line {reader.line_num} of '{path}' is no CSV ({error}); correct the line"
        ) from None
    return [(line, fields) for line, fields in rows if any(fields)]
