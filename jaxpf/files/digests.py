"""Digests of a run's tables in its summary.json: a cut or altered table is refused."""

import hashlib
import json
from collections.abc import Iterable
from pathlib import Path

from jaxpf.contract.errors import InputError

#: Written last, into the folder of the tables.
SUMMARY = "summary.json"


def digests(folder: Path, names: Iterable[str]) -> dict[str, dict[str, int | str]]:
    """Number of rows and digest of those tables of a folder that exist, by name."""
    paths = (folder / name for name in names)
    return {path.name: _digest(path.read_bytes()) for path in paths if path.is_file()}


def check_unchanged(path: Path) -> None:
    """Refuse a table that differs from what the summary beside it says, if that mentions it."""
    try:
        expected = json.loads((path.parent / SUMMARY).read_bytes())["tables"][path.name]
        found = _digest(path.read_bytes())
        rows = int(expected["rows"])
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return  # not a table of a finished run, or unreadable, which its reader reports
    if found != expected:
        raise InputError(
            f"'{path}' was cut or changed after the run: it has {found['rows']} rows, and "
            f"{SUMMARY} beside it records {rows}, with another digest; track again, or move the "
            "table elsewhere if the change is meant"
        )


def _digest(content: bytes) -> dict[str, int | str]:
    return {
        "rows": max(content.count(b"\n") - 1, 0),
        "sha256": hashlib.sha256(content).hexdigest(),
    }
