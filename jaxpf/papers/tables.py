"""Tables for readers, as text and as Markdown."""

import dataclasses
from collections.abc import Iterable, Sequence
from typing import Any

#: Label and one cell for every further column.
Rows = list[tuple[str, list[Any]]]


@dataclasses.dataclass(frozen=True)
class Table:
    """A table; a cell is a text, or an object that ``str`` turns into one.

    Attributes:
        name: stem of its file.
        title: one line above the table, with units.
        columns: header, starting with the label's column.
        rows: ``(label, cells)``.
        note: remark for the reader; may be empty.
    """

    name: str
    title: str
    columns: list[str]
    rows: Rows
    note: str = ""

    def add(self, column: str, cells: Iterable[object]) -> None:
        """Append a column with one cell per row."""
        self.columns.append(column)
        for (_, others), cell in zip(self.rows, cells, strict=True):
            others.append(cell)

    def texts(self) -> list[list[str]]:
        """Rows of text for printing."""
        return [[label, *map(str, cells)] for label, cells in self.rows]


def markdown_table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """A table as Markdown lines."""
    return [_line(columns), "|" + " --- |" * len(columns), *map(_line, rows)]


def _line(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cell.replace("|", r"\|") for cell in cells) + " |"
