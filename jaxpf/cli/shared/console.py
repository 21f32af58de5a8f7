"""All that is printed: lines, tables with an explanation of their terms, and progress bars."""

import re
import sys
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from rich.progress import Progress, Task

#: Controls, overrides of the direction, and halves of characters, which cannot be encoded.
_CONTROLS = re.compile(
    "[\0-\b\x0b-\x1f\x7f-\x9f\N{LEFT-TO-RIGHT EMBEDDING}-\N{RIGHT-TO-LEFT OVERRIDE}"
    "\N{LEFT-TO-RIGHT ISOLATE}-\N{POP DIRECTIONAL ISOLATE}\ud800-\udfff]"
)
_TRACKED = "overlapping the truth at all"
#: Prefix of a term -> explanation; a line under each table explains the terms it uses.
_TERMS = {
    "success at": "frames whose IoU is above that",
    "success auc": "mean of that share over all thresholds",
    "success": "tracked in every frame",
    "recover": "tracked in the last frame with truth",
    "tracked": _TRACKED,
    "distinct": "particles that carry different draws of the object",
    "iou": "intersection over union",
    "precision": "share of the estimate that lies on the truth",
    "recall": "share of the truth that the estimate covers",
    "centre_error": "distance of the centres in pixels",
    "centre error": "distance of the centres in pixels",
    "truth in the": "frames in which that region of x and y covers it, while it is tracked",
    "size in the": "the same for the size of the box",
    "confidence, area": "under the curve, for boxes on and off their object",
    "crps": "pixels; small where intervals are calibrated and narrow",
    "hota": "places and identities, from 0 to 1",
    "deta": "places alone",
    "assa": "identities alone",
    "idf1": "F1 of boxes under the right identity",
    "mota": "1 less FP, FN and IDSW per true box",
    "motp": "mean IoU of the boxes found",
    "fp": "boxes without an object",
    "fn": "objects without a box",
    "idsw": "changes of identity",
    "frag": "interruptions of a track",
    "error of repeats": "standard error, from the scatter of the descents",
    "error of frames": "standard error, from the curvature of the evidence",
    "compared with": "differences are paired by run",
    "ordering": "the order in which objects are sampled",
    "done": "finished runs on disk",
    "frames/s": "of a single run, without compilation",
    "ms a frame": "of a single run, without compilation",
}
#: Width of a pipe in characters.
_UNBOUNDED = 10_000


def say(text: str = "", err: bool = False) -> None:
    """Print text on standard output, or on standard error with ``err``; see ``visible``."""
    click.echo(visible(text), err=err)


def visible(text: str) -> str:
    """Escape all characters that would control the terminal, except for ends of lines and tabs.

    Names of files and objects may hold any, such as escape codes or marks that reverse the text.
    """
    return _CONTROLS.sub(lambda mark: mark[0].encode("unicode_escape").decode("ascii"), text)


def print_table(
    title: str, columns: Sequence[str], rows: Iterable[Sequence[str]], explain: bool = True
) -> None:
    """Print a table and an explanation of its terms, unless its note has one.

    The first column is left-aligned, numbers right-aligned.  Texts are printed without markup.
    """
    from rich.console import Console
    from rich.table import Table

    table = Table(title=visible(title), title_justify="left")
    for index, column in enumerate(columns):
        table.add_column(visible(column), justify="left" if index == 0 else "right")
    rows = list(rows)
    for row in rows:
        table.add_row(*map(visible, row))
    # A pipe or a file has no width: no cell breaks over lines.
    Console(width=None if sys.stdout.isatty() else _UNBOUNDED, markup=False, emoji=False).print(
        table
    )
    if explain and (terms := _terms([*columns, *(row[0] for row in rows if row)])):
        say(terms)


def _terms(names: Iterable[str]) -> str:
    """A line that explains the terms in a table's columns and rows; "" if there are none."""
    used: dict[str, str] = {}
    for name in names:
        word = name.partition(",")[0].partition(" (")[0]
        term = next(filter(word.lower().removeprefix("smith2004 ").startswith, _TERMS), None)
        if term is not None:
            used.setdefault(term, f"{word}: {_TERMS[term]}")
    if {"success", "recover", "tracked"} & used.keys():  # the others need it, so it comes last
        used.pop("tracked", None)
        used["tracked"] = f"tracked: {_TRACKED}"
    return "; ".join(used.values()) + "." if used else ""


def progress_bar(unit: str) -> "Progress":
    """A progress bar on standard error, with ``unit`` per second and the remaining time."""
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeRemainingColumn,
    )
    from rich.text import Text

    class Rate(TextColumn):
        def render(self, task: "Task") -> Text:
            return Text("" if task.speed is None else f"{task.speed:.1f} {unit}/s")

    return Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        Rate(""),
        TextColumn("left"),
        TimeRemainingColumn(),
        console=Console(stderr=True),
    )
