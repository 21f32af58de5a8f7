"""``jaxpf mark`` and ``jaxpf view``."""

import webbrowser
from pathlib import Path
from typing import Any

import click

from jaxpf.boxes.tracks import read_boxes
from jaxpf.cli.marking.drawing import Marking
from jaxpf.cli.marking.starts import SUFFIXES
from jaxpf.cli.shared import flags
from jaxpf.cli.shared.console import say
from jaxpf.cli.shared.flags import Command, GivenPath
from jaxpf.files.writing import csv_text
from jaxpf.media.page.runs import Run
from jaxpf.media.page.server import Server

_keep = click.option("--keep", is_flag=True, help="Keep serving after the page is closed.")
_open = click.option("--open/--no-open", "opens", default=True, help="Open the browser.")
_kind = click.option(
    "--target", "kind", type=click.Choice(list(SUFFIXES)), help="Kind of target.  [default: boxes]"
)


@click.command("mark", cls=Command)
@click.argument("video")
@_kind
@flags.whole("--start", default=0, most=2**31 - 1, help="Frame shown first, from 0.")
@flags.grey_range
@flags.output(
    "Start file to write, or to edit.  [default: NAME-TARGET.csv beside VIDEO; .json for contours]"
)
@_open
@_keep
def mark(
    video: str,
    kind: str | None,
    start: int,
    range: list[int] | None,
    output: Path | None,
    opens: bool,
    keep: bool,
) -> None:
    """Draw boxes, points, part trees or contours on VIDEO in the browser.

    The start file is written as you draw, and an existing one is opened for editing; a file with
    other columns is shown and never changed.  The page prints the command that tracks from it, and
    its button Track runs it into jaxpf-NAME, asking before it replaces results.  The page is served
    on this machine alone, until it has been closed for a minute and its run has ended.
    """
    marking = Marking(video, kind, output, start, range=range)
    drawn = marking.about()["items"]
    _serve(marking, drawn[0]["frame"] if drawn else start, opens, keep)


@click.command("view", cls=Command)
@click.argument("folder", type=GivenPath())
@click.argument("beside", type=GivenPath(), required=False)
@click.option("--video", help="The film.  [default: the one that was tracked]")
@_open
@_keep
def view(folder: Path, beside: Path | None, video: str | None, opens: bool, keep: bool) -> None:
    """Review the tracks in FOLDER, finished or running, in the browser.

    BESIDE is a second run's folder, or a CSV of true boxes, shown beside the first.  A box or
    point drawn in a doubtful frame corrects the first object named below the picture: starts and
    corrections are kept in FOLDER/corrections-TARGET.csv, and the button Track repeats the run from
    them with its options, asking before it replaces the results.
    """
    run = Run(folder.resolve() if folder.name in ("", "..") else folder)
    values = None if video else run.table.get("range")
    marking = Marking(video or run.video, run.kind, None, run.start, run, values)
    if beside is not None:
        marking.shown.append(Run(beside) if beside.is_dir() else _Truth(beside))
    _serve(marking, run.start, opens, keep)


class _Truth:
    """True boxes of a CSV, in the place of a run."""

    def __init__(self, path: Path):
        table, self.name = read_boxes(path, truth=True), str(path)
        columns = (table.frame.tolist(), table.id.tolist(), table.box.tolist())
        rows = ([frame, name, *box] for frame, name, box in zip(*columns, strict=True))
        self._text = csv_text([["frame", "id", "x", "y", "w", "h"], *rows])

    def since(self, at: dict[str, int]) -> dict[str, Any]:
        """See ``jaxpf.media.page.runs.Run``."""
        return {
            "tracks": "" if at["tracks"] else self._text,
            "outlines": "",
            "at": {"file": 0, "tracks": 1, "outlines": 0},
            "is_new": False,
            "running": False,
        }


def _serve(marking: Marking, start: int, opens: bool, keep: bool) -> None:
    note = marking.note()
    if not marking.source.frames_expected:
        say("Counting the frames, as the film's header does not.")
    answers = {
        name: getattr(marking, name) for name in ("about", "save", "track", "progress", "result")
    }
    server = Server(
        marking.source, answers, kind=marking.kind, start=start, note=note, can_track=not note
    )
    say(f"{server.url}\nThe page is open until you press Ctrl-C or close it.")
    if note:
        say(f"Note: {note}", err=True)
    try:
        if opens:
            webbrowser.open(server.url)
        server.wait(lambda: keep or marking.is_running)
    except KeyboardInterrupt:
        say("Closed.")
    finally:
        server.close()
        if marking.is_running:
            say(marking.how_to_end())
