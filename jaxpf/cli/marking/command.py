"""``jaxpf mark`` and ``jaxpf view``."""

import shlex
import subprocess
import sys
import webbrowser
from pathlib import Path
from typing import Any

import click

from jaxpf.boxes.tracks import read_boxes
from jaxpf.cli.marking.starts import SUFFIXES, Shapes, read_start, typed_start, write_start
from jaxpf.cli.shared import plain
from jaxpf.cli.shared.config import write_config
from jaxpf.cli.shared.console import say
from jaxpf.cli.shared.plain import GivenPath, PlainCommand
from jaxpf.cli.tracking.request import NOT_WITH_LATER
from jaxpf.contract.errors import InputError
from jaxpf.media.page.runs import Run
from jaxpf.media.page.server import Server, described
from jaxpf.media.video import open_frames
from jaxpf.targets.later import holds_whole_tracks

#: Lines of a run's output that the page shows.
_LINES = 8
#: Options of runs whose objects the page cannot correct.
_NOT_CORRECTED = ("detections", "mask", "ids", *NOT_WITH_LATER, "order")

_keep = click.option("--keep", is_flag=True, help="Keep serving after the page is closed.")
_open = click.option("--open/--no-open", "opens", default=True, help="Open the browser.")
_kind = click.option(
    "--target", "kind", type=click.Choice(list(SUFFIXES)), help="Kind of target.  [default: boxes]"
)


@click.command("mark", cls=PlainCommand)
@click.argument("video")
@_kind
@plain.whole("--start", default=0, most=2**31 - 1, help="Frame shown first, from 0.")
@plain.output(
    "Start file to write, or to edit.  [default: NAME-TARGET.csv beside VIDEO; .json for contours]"
)
@_open
@_keep
def mark(
    video: str, kind: str | None, start: int, output: Path | None, opens: bool, keep: bool
) -> None:
    """Draw boxes, points, part trees or contours on VIDEO in the browser.

    The start file is written as you draw, and an existing one is opened for editing.  The page
    prints the command that tracks from it, and its button Track runs it, replacing earlier results
    in jaxpf-NAME.  The page is served on this machine alone, until it has been closed for a minute.
    """
    marking = _Marking(video, kind, output)
    shapes = marking.existing(start)
    _serve(marking, shapes, [], start if not shapes else shapes[0]["frame"], opens, keep)


@click.command("view", cls=PlainCommand)
@click.argument("folder", type=GivenPath())
@click.argument("beside", type=GivenPath(), required=False)
@click.option("--video", help="The film.  [default: the one that was tracked]")
@_open
@_keep
def view(folder: Path, beside: Path | None, video: str | None, opens: bool, keep: bool) -> None:
    """Review the tracks in FOLDER, finished or running, in the browser.

    BESIDE is a second run's folder, or a CSV of true boxes, shown beside the first.  A box or
    point drawn in a doubtful frame corrects the first object named below the picture: it is added
    to the start file, and the button Track repeats the run with its options, replacing its results.
    """
    run = Run(folder.resolve() if folder.name in ("", "..") else folder)
    second = [] if beside is None else [Run(beside) if beside.is_dir() else _Truth(beside)]
    marking = _Marking(video or run.video, run.kind, run.start_file, run)
    _serve(marking, marking.existing(run.start), [run, *second], run.start, opens, keep)


class _Truth:
    """True boxes of a CSV, in the place of a run."""

    def __init__(self, path: Path):
        table = read_boxes(path, truth=True)
        rows = [
            ",".join(map(str, (frame, name, *box)))
            for frame, name, box in zip(
                table.frame.tolist(), table.id.tolist(), table.box.tolist(), strict=True
            )
        ]
        self.name = str(path)
        self._text = "\n".join(["frame,id,x,y,w,h", *rows]) + "\n"

    def since(self, at: dict[str, int]) -> dict[str, Any]:
        """See ``jaxpf.media.page.runs.Run``."""
        text = "" if at["tracks"] else self._text
        return {
            "tracks": text,
            "outlines": "",
            "at": {"file": 0, "tracks": 1, "outlines": 0},
            "is_new": False,
            "closed": False,
            "running": False,
        }


class _Marking:
    """What is drawn on a film, where it is written, and the run that tracks from it."""

    def __init__(
        self, video: str, kind: str | None, output: Path | None, reviewed: Run | None = None
    ):
        self.source = open_frames(video)
        if self.source.is_live:
            raise InputError(f"'{video}' is live; record it to a file, and mark that.")
        self.video = video
        self.kind = kind or ("contours" if output and output.suffix == ".json" else "boxes")
        self.output = output
        self.reviewed = reviewed
        self.folder = reviewed.folder if reviewed else Path(f"jaxpf-{self.source.name}")
        self.is_gone = reviewed is not None and output is not None and not output.is_file()
        if reviewed is not None and output is None:  # objects were typed, not read from a file
            self.output = reviewed.folder.with_name(f"{reviewed.folder.name}-{kind}.csv")
        self.run: subprocess.Popen[str] | None = None

    def file(self, kind: str) -> Path:
        """The start file of a kind of target."""
        if self.output is not None and kind == self.kind:
            return self.output
        beside = Path(self.source.path).parent
        return beside / f"{self.source.name}-{kind}{SUFFIXES[kind]}"

    def existing(self, frame: int) -> Shapes:
        """The shapes of start files; of a run without one, those that were typed."""
        kinds = [kind for kind in SUFFIXES if self.file(kind).is_file() and not self._is_old(kind)]
        read = [shape for kind in kinds for shape in read_start(self.file(kind), kind, frame)]
        if self.reviewed is None or self.kind in kinds:
            return read
        return [*typed_start(self.reviewed.table, frame), *read]

    def _is_old(self, kind: str) -> bool:
        """Whether the file was drawn for an earlier run, since this one's objects were typed."""
        if self.reviewed is None or kind != self.kind or self.reviewed.start_file is not None:
            return False
        return self.file(kind).stat().st_mtime < self.configuration.stat().st_mtime

    def command(self, kind: str, shapes: Shapes) -> list[str]:
        """Arguments of the command that tracks from the start file, as the reviewed run did."""
        frames, usual = {shape["frame"] for shape in shapes}, 0
        given = [] if kind == "boxes" else [kind]
        given += [str(self.video)]
        run = self.reviewed if kind == self.kind else None
        if run is not None:
            given += ["--config", str(self.configuration)]
            usual = run.start
        if run is None or run.start_file is None:
            given += [f"--{kind}", str(self.file(kind))]
        if usual not in frames:
            given += ["--start", str(min(frames))]
        return ["track", *given]

    def save(self, content: Any) -> dict[str, str]:
        """Write the start file, as the page asks; an emptied drawing removes it."""
        kind, shapes = content["kind"], content["items"]
        if kind not in SUFFIXES:
            raise InputError(f"there is no kind of target {kind!r:.60}; use {', '.join(SUFFIXES)}.")
        path = self.file(kind)
        if self.reviewed is not None and kind == self.kind:
            self._check_correction(self.reviewed.table, shapes)
        if not shapes:
            path.unlink(missing_ok=True)
            return {"file": "", "command": ""}
        write_start(path, kind, shapes)
        return {"file": str(path), "command": shlex.join(["jaxpf", *self.command(kind, shapes)])}

    def _check_correction(self, table: dict[str, Any], shapes: Shapes) -> None:
        """Refuse shapes with which a run of this configuration cannot be repeated."""
        refused = [name for name in _NOT_CORRECTED if table.get(name)]
        if len(table.get("noise_relative", ())) > 3:  # three for each object
            refused.append("noise_relative")
        if refused:
            raise InputError(
                f"a run with --{refused[0].replace('_', '-')} cannot be corrected here; track "
                f"without it, from a file of start {self.kind} (--{self.kind})."
            )
        if self.is_gone:
            raise InputError(
                f"the start file '{self.output}' of this run is no longer a file; put it back to "
                "correct the run."
            )
        if holds_whole_tracks({(shape["frame"], shape["name"]) for shape in shapes}):
            raise InputError(
                "an object has shapes in three frames in a row, which count as a finished track, "
                "not as corrections; delete some."
            )

    def track(self, content: Any) -> dict[str, str]:
        """Start the run of the drawn shapes."""
        self.stop()
        self.save(content)
        if self.reviewed is not None:  # a run that was stopped may have removed it
            write_config(self.configuration, "track", self.reviewed.table)
        given = self.command(content["kind"], content["items"])
        with open(self.log, "w") as log:
            self.run = subprocess.Popen(
                [sys.executable, "-m", "jaxpf", *given, "-o", str(self.folder), "--overwrite"],
                stdout=log,
                stderr=subprocess.STDOUT,
                text=True,
            )
        return {"output": str(self.folder)}

    @property
    def configuration(self) -> Path:
        """The options of the reviewed run."""
        return self.folder / "run.toml"

    @property
    def log(self) -> Path:
        """What the run prints."""
        return self.folder.with_name(f".{self.folder.name}.log")

    def progress(self, content: Any) -> dict[str, Any]:
        """Whether the run goes on, and its last lines."""
        if self.run is None:
            return {"running": False, "text": "", "failed": False}
        lines = self.log.read_text(errors="replace").splitlines()[-_LINES:]
        return {
            "running": self.run.poll() is None,
            "text": "\n".join(lines),
            "failed": bool(self.run.poll()),
        }

    def stop(self) -> None:
        """End the run, which keeps what it has tracked, and remove its log."""
        if self.run is not None and self.run.poll() is None:
            self.run.terminate()
            self.run.wait()
        self.log.unlink(missing_ok=True)


def _serve(
    marking: _Marking, shapes: Shapes, runs: list[Run | _Truth], start: int, opens: bool, keep: bool
) -> None:
    source, shown = marking.source, list(runs)

    def result(content: Any) -> dict[str, Any]:
        return shown[content["index"]].since(content["at"])

    def save(content: Any) -> dict[str, str]:
        saved = marking.save(content)
        others = [shape for shape in shapes if shape["kind"] != content["kind"]]
        shapes[:] = others + content["items"]  # the page may be loaded again
        return saved

    def track(content: Any) -> dict[str, str]:
        started = marking.track(content)
        run = Run(marking.folder, is_waited_for=True)
        run.kind, run.start_file = content["kind"], marking.file(content["kind"])
        shown[:] = [run]
        return started

    about = described(
        source, kind=marking.kind, items=shapes, start=start, results=[run.name for run in runs]
    )
    answers = {
        "save": save,
        "track": track,
        "progress": marking.progress,
        "result": result,
    }
    server = Server(source, about | {"can_track": True}, answers)
    say(f"{server.url}\nThe page is open until you press Ctrl-C or close it.")
    try:
        if opens:
            webbrowser.open(server.url)
        server.wait(keep)
    except KeyboardInterrupt:
        say("Closed.")
    finally:
        server.close()
        marking.stop()
