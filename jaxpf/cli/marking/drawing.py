"""What the page shows and draws: where it is kept, and the run that tracks from it."""

import hashlib
import shlex
import subprocess
import sys
import tempfile
import threading
from pathlib import Path
from typing import Any

from jaxpf.cli.marking.starts import (
    SUFFIXES,
    Shapes,
    check_start,
    read_start,
    save_start,
    typed_start,
)
from jaxpf.cli.shared.flags import write_config
from jaxpf.cli.tracking.request import NOT_WITH_LATER
from jaxpf.contract.errors import InputError
from jaxpf.files.store import is_locked
from jaxpf.files.writing import is_left_over, remove_leavings, report_os_errors
from jaxpf.media.page.runs import Run
from jaxpf.media.page.server import Conflict
from jaxpf.media.read import open_frames
from jaxpf.targets.target import holds_whole_tracks

#: Lines of a run's output that the page shows.
_LINES = 8
#: Options of runs whose objects the page cannot correct.
_NOT_CORRECTED = ("detections", "mask", "ids", *NOT_WITH_LATER, "order")


class Marking:
    """What is drawn on a film, where it is written, and the run that tracks from it.

    Methods that take ``content``, the JSON of a request, answer the page.

    Attributes:
        reviewed: the run whose objects are corrected, by ``jaxpf view``.  It is repeated with its
            options, from a file of starts and corrections in its folder.
        shown: the results that the page shows.
        run: the process of the run that was started here.
    """

    def __init__(
        self,
        video: str,
        kind: str | None,
        output: Path | None = None,
        start: int = 0,
        reviewed: Run | None = None,
        range: list[int] | None = None,
    ):
        self.source = open_frames(video, range=range)
        if self.source.is_live:
            raise InputError(f"'{video}' is live; record it to a file, and mark that.")
        self.video, self.start, self.range, self.reviewed = video, start, range, reviewed
        self.kind = kind or ("contours" if output and output.suffix == ".json" else "boxes")
        self.output = output
        self.folder = reviewed.folder if reviewed else Path(f"jaxpf-{self.source.name}")
        self.configuration = self.folder / "run.toml"
        self.shown: list[Any] = [reviewed] if reviewed else []
        if not reviewed and is_locked(self.folder):
            self.shown = [Run(self.folder, None if self.configuration.is_file() else {})]
        own, self.given = self.file(self.kind), reviewed.start_file if reviewed else None
        remove_leavings(own.parent, f"{own.stem}.")
        if self.given and not self.given.is_file() and self.given.name == own.name:
            self.given = own  # the folder was moved
        # Corrections of an earlier run that was tracked into the same folder.
        is_own = self.given is not None and self.given.resolve() == own.resolve()
        is_old = reviewed and own.is_file() and not is_own
        is_old = is_old and own.stat().st_mtime < self.configuration.stat().st_mtime
        self._old = _digest(own) if is_old else None
        self.run: subprocess.Popen[bytes] | None = None
        self._log: Any = None
        self._saving = threading.Lock()

    def file(self, kind: str) -> Path:
        """The start file of a kind of target; of a reviewed run, its own file of corrections."""
        if self.reviewed is not None:
            return self.folder / f"corrections-{kind}{SUFFIXES[kind]}"
        if self.output is not None and kind == self.kind:
            return self.output
        beside = Path(self.source.path).parent
        return beside / f"{self.source.name}-{kind}{SUFFIXES[kind]}"

    def about(self, content: Any = None) -> dict[str, Any]:
        """What is drawn, the digests of its files, and the names of the results.

        Of a reviewed run without corrections, its starts are drawn.
        """
        items: Shapes = []
        digests = {}
        for kind in SUFFIXES:
            path, found = self.file(kind), _digest(self.file(kind))
            if found and found != self._old:
                items += read_start(path, kind, self.start)
                digests[kind] = found
            elif self.reviewed is not None and kind == self.kind:
                items += self._starts(self.reviewed)
        return {"items": items, "digests": digests, "results": [run.name for run in self.shown]}

    def _starts(self, run: Run) -> Shapes:
        """Where the objects of a run started; of whole tracks, their boxes in its first frame."""
        if self.given is None:
            return typed_start(run.table, run.start)
        shapes = read_start(self.given, self.kind, run.start) if self.given.is_file() else []
        if not _are_whole_tracks(shapes):
            return shapes
        return [shape for shape in shapes if shape["frame"] == run.start]

    def command(self, kind: str, shapes: Shapes) -> list[str]:
        """Arguments of the command that tracks from the start file, as the reviewed run did."""
        frames, usual, options = {shape["frame"] for shape in shapes}, 0, []
        if self.reviewed is not None and kind == self.kind:
            options, usual = ["--config", str(self.configuration)], self.reviewed.start
        elif self.range:
            options = ["--range", ",".join(map(str, self.range))]
        named = [] if kind == "boxes" else [kind]
        begin = [] if usual in frames else ["--start", str(min(frames))]
        return ["track", *named, self.video, *options, f"--{kind}", str(self.file(kind)), *begin]

    def note(self) -> str:
        """Why the given start file will not be written, if so."""
        try:
            check_start(self.file(self.kind), self.kind)
        except InputError as error:
            return str(error)
        return ""

    def save(self, content: Any) -> dict[str, str]:
        """Write the start file, as the page asks; an emptied drawing removes it.

        Raises:
            Conflict: the file is not the one that the page has read, of which it gives the digest.
        """
        kind, shapes = content["kind"], content["items"]
        path = self.file(kind)
        if self.reviewed is not None and kind == self.kind:
            self._check_correction(self.reviewed.table, shapes)
        with self._saving:
            check_start(path, kind)
            found = _digest(path)
            if content.get("digest", "") != found:
                raise Conflict(
                    f"'{path}' was changed by another page or program.",
                    digest=found,
                    items=read_start(path, kind, self.start) if found else [],
                )
            if not shapes:
                with report_os_errors("remove", path):
                    path.unlink(missing_ok=True)
                return {"file": "", "command": "", "digest": ""}
            try:
                save_start(path, kind, shapes)
            except InputError as error:
                raise Conflict(str(error), 400, digest=_digest(path)) from None
            command = shlex.join(["jaxpf", *self.command(kind, shapes)])
            return {"file": str(path), "command": command, "digest": _digest(path)}

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
        if self.given is not None and not self.given.is_file():
            raise InputError(
                f"the start file '{self.given}' of this run is no longer a file; put it back to "
                "correct the run."
            )
        if _are_whole_tracks(shapes):
            raise InputError(
                "an object has shapes in three frames in a row, which count as a finished track, "
                "not as corrections; delete some."
            )

    def track(self, content: Any) -> dict[str, str]:
        """Start the run of the drawn shapes, which goes on when the page or this program ends.

        Raises:
            Conflict: it would replace other results, or a run, and the page has not asked for that.
        """
        kind = content["kind"]
        if not content.get("replaces") and (self.is_running or self._holds_results()):
            state = "A run is writing its" if self.is_running else "There are"
            raise Conflict(f"{state} results in '{self.folder}'.")
        if self.run is not None and self.run.poll() is None:
            self.run.terminate()  # it keeps what it has tracked
            self.run.wait()
        if self.is_running:
            raise InputError(f"another program is tracking into '{self.folder}'; wait for it.")
        if self.reviewed is not None:  # a run that was stopped may have removed it
            write_config(self.configuration, "track", self.reviewed.table)
        self.save(content)  # corrections are newer than the options of the run
        given = self.command(kind, content["items"])
        self._log = tempfile.NamedTemporaryFile()  # noqa: SIM115
        self.run = subprocess.Popen(
            [sys.executable, "-m", "jaxpf", *given, "-o", str(self.folder), "--overwrite"],
            stdin=subprocess.DEVNULL,
            stdout=self._log,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
        self.shown = [Run(self.folder, {"target": kind, kind: self.file(kind)})]
        return {"output": str(self.folder)}

    def _holds_results(self) -> bool:
        starts = {self.file(kind).name for kind in SUFFIXES}
        with report_os_errors("read", self.folder):
            return self.folder.is_dir() and any(
                not is_left_over(each) and each.name not in starts for each in self.folder.iterdir()
            )

    @property
    def is_running(self) -> bool:
        """Whether a run is going on, of this program or another."""
        return (self.run is not None and self.run.poll() is None) or is_locked(self.folder)

    def progress(self, content: Any) -> dict[str, Any]:
        """Whether the run goes on, and its last lines."""
        answer = {"running": self.is_running, "text": "", "failed": False}
        if self.run is not None:
            lines = Path(self._log.name).read_text(errors="replace").splitlines()
            answer |= {"text": "\n".join(lines[-_LINES:]), "failed": bool(self.run.poll())}
        return answer

    def result(self, content: Any) -> dict[str, Any]:
        """What a run has written since the page asked last."""
        return self.shown[content["index"]].since(content["at"])

    def how_to_end(self) -> str:
        """How the run that goes on is seen and ended."""
        end = f"  `kill {self.run.pid}` ends it, and keeps what it has tracked." if self.run else ""
        return f"The run goes on; `jaxpf view {shlex.quote(str(self.folder))}` shows it.{end}"


def _are_whole_tracks(shapes: Shapes) -> bool:
    return holds_whole_tracks({(shape["frame"], shape["name"]) for shape in shapes})


def _digest(path: Path) -> str:
    """Of a file's content; "" if there is no file."""
    with report_os_errors("read", path):
        return hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else ""
