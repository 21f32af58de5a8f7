"""Tables of text as Markdown."""

from collections.abc import Sequence


def markdown_table(
    columns: Sequence[str], rows: Sequence[Sequence[str]], special: str = "|"
) -> list[str]:
    """A table as Markdown lines; ``special`` holds the characters to escape in cells."""
    return [
        _line(columns, special),
        "|" + " --- |" * len(columns),
        *(_line(row, special) for row in rows),
    ]


def escaped(text: str, special: str) -> str:
    """A text with a backslash before each of the special characters of Markdown."""
    return "".join(f"\\{mark}" if mark in special else mark for mark in text)


def _line(cells: Sequence[str], special: str) -> str:
    return "| " + " | ".join(escaped(cell, special) for cell in cells) + " |"
