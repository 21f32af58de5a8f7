"""Reads text files and tables, with a clear message for every way in which reading can fail."""

import codecs
import csv
import json
import math
import unicodedata
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from jaxpf.contract.errors import InputError

T = TypeVar("T")

#: What parsing may raise of a file with other content.
_FAULTS = ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError
#: Limits of a coordinate in pixels and of a whole number, beyond which floats lose precision.
FARTHEST, LARGEST_WHOLE = 1e9, 2**53 - 1
#: Longest name, and the Unicode categories that break a line of a table or cannot be encoded.
_LONGEST_NAME, _UNFIT = 200, ("Cc", "Cs", "Zl", "Zp")


def read_text(path: Path, what: str, expected: str) -> str:
    """Read a text file: UTF-8 with or without a byte order mark, or UTF-16 with one.

    Messages name the kind of content, such as ``"boxes"``, and what was ``expected`` instead.
    """
    if path.is_dir():
        raise InputError(f"'{path}' is a folder; give a file of {what}: {expected}")
    try:
        content = path.read_bytes()
        is_utf_16 = content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
        text = content.decode("utf-16" if is_utf_16 else "utf-8-sig")
    except FileNotFoundError:
        raise InputError(f"there is no file of {what} at '{path}'; check the path") from None
    except UnicodeDecodeError:
        raise InputError(f"'{path}' is not a text file; give {expected}") from None
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise InputError(f"cannot read '{path}': {reason}; check its permissions") from error
    if "\0" in text:
        raise InputError(f"'{path}' is not a text file, as it holds NUL bytes; give {expected}")
    return text


def read_json(path: Path, what: str, expected: str, parse: Callable[[dict[str, Any]], T]) -> T:
    """Read a JSON object with ``parse``; whatever is wrong with the file is one sentence.

    JSON would silently drop the first of two values of one name, which are refused.

    Args:
        path: the file.
        what: the kind of content, for messages.
        expected: what to give instead, for messages.
        parse: function of the object that raises any error if it is not as expected.
    """

    def unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        names = [name for name, _ in pairs]
        if twice := [name for name in names if names.count(name) > 1]:
            raise ValueError(f"it has '{twice[0]:.60}' twice")
        return dict(pairs)

    text = read_text(path, what, expected)
    try:
        content = json.loads(text, object_pairs_hook=unique)
        if not isinstance(content, dict):
            raise ValueError("it is no object {...}")
        return parse(content)
    except _FAULTS as e:
        cause = f"it has no {e}" if isinstance(e, KeyError) else " ".join(f"{e}".split())
        raise InputError(
            f"'{path}' is no file of {what} ({cause[:500].rstrip('.')}); give {expected}"
        ) from None


def parse_number(
    field: str,
    place: str,
    remedy: str,
    *,
    least: float = -FARTHEST,
    most: float = FARTHEST,
    whole: bool = False,
) -> float:
    """Parse a field, such as ``"1"``, ``"1.0"`` or ``"1e2"``, as a finite number.

    Messages begin with the ``place`` and what it holds, ``"line 3 of 'a.csv': x is"``, and end with
    the ``remedy``.
    """
    try:
        value = math.nan if "_" in field else float(field)  # only Python accepts 1_000
    except ValueError:
        value = math.nan
    if math.isfinite(value):
        if least <= value <= most and not (whole and value % 1):
            return value
        kind = "whole number" if whole else "number"
        raise InputError(f"{place} {field[:40]!r}; give a {kind} from {least:.0f} to {most:.0f}")
    raise InputError(f"{place} {field[:40]!r}, which is not a finite number; {remedy}")


def check_pixels(what: str, values: np.ndarray) -> None:
    """Refuse coordinates of several points or boxes that are shares of the frame's size."""
    # The corners of boxes may be shifted by a pixel.  Whole numbers are label images of few pixels.
    if values.size > 2 and np.abs(values).max() <= 2 and (values % 1).any():
        raise InputError(
            f"{what} have values of 0 to 1 only, as shares of the frame's size; multiply x and "
            "widths by the frame's width in pixels, y and heights by its height"
        )


def check_name(name: str, place: str) -> None:
    """Refuse an object's name that does not fit in one field of a table, at a ``place``."""
    is_unfit = any(unicodedata.category(letter) in _UNFIT for letter in name)
    if not name.strip() or len(name) > _LONGEST_NAME or is_unfit:
        raise InputError(
            f"{place} has the name {name[:40]!r}; give 1 to {_LONGEST_NAME} letters on one line"
        )


def read_rows(path: Path, what: str, expected: str) -> list[tuple[int, list[str]]]:
    """Read a table; return line number and stripped fields of every non-blank line.

    The separator is a comma, unless the first line contains semicolons or tabs.  Columns at the end
    that are empty throughout, which spreadsheets write, are left out.
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
    used = [number for _, fields in rows for number, field in enumerate(fields, 1) if field]
    return [(line, fields[: max(used)]) for line, fields in rows if any(fields)]


def read_below(path: Path, what: str, *headers: str) -> list[tuple[str, list[str]]]:
    """Read a table; return the place for messages and the fields of every line below the header.

    Raises:
        InputError: the first line is none of ``headers``, or a line has another number of fields.
    """
    header, *rows = read_rows(path, what, f"a table with the header {headers[0]}") or [(1, [])]
    if ",".join(header[1]).lower() not in headers:
        raise InputError(
            f"'{path}' begins with '{','.join(header[1])[:80]}'; its first line must be "
            f"{' or '.join(headers)}"
        )
    for line, fields in rows:
        if len(fields) != len(header[1]):
            raise InputError(
                f"line {line} of '{path}' has {len(fields)} columns; expected {len(header[1])}: "
                f"{','.join(header[1])}"
            )
    return [(f"line {line} of '{path}'", fields) for line, fields in rows]
