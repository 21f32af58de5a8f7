"""What is drawn on the page: where it is kept, and the run that tracks from it."""

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
from jaxpf.files.writing import is_left_over, report_os_errors
from jaxpf.media.film import Reading
from jaxpf.media.page.runs import Run
from jaxpf.media.page.server import Refusal
from jaxpf.media.read import open_frames
from jaxpf.targets.later import holds_whole_tracks

#: Lines of a run's output that the page shows.
_LINES = 8
#: Options of runs whose objects the page cannot correct.
_NOT_CORRECTED = ("detections", "mask", "ids", *NOT_WITH_LATER, "order")


class Marking:
    """What is drawn on a film, where it is written, and the run that tracks from it."""

    def __init__(
        self,
        video: str,
        kind: str | None,
        output: Path | None,
        start: int,
        reviewed: Run | None = None,
        range: list[int] | None = None,
    ):
        self.source = open_frames(video, Reading(range=range))
        self.range = range
        if self.source.is_live:
            raise InputError(f"'{video}' is live; record it to a file, and mark that.")
        self.video = video
        self.kind = kind or ("contours" if output and output.suffix == ".json" else "boxes")
        self.output, self.start, self.reviewed = output, start, reviewed
        self.folder = reviewed.folder if reviewed else Path(f"jaxpf-{self.source.name}")
        self.given = None if reviewed is None else reviewed.start_file
        mine = self.file(self.kind)
        if self.given and not self.given.is_file() and self.given.name == mine.name:
            self.given = mine  # the folder was moved
        self.is_gone = self.given is not None and not self.given.is_file()
        # Corrections of an earlier run that was tracked into the same folder.
        self._old = digest(mine) if self._is_old(mine) else None
        self._saving = threading.Lock()
        self.run: subprocess.Popen[bytes] | None = None
        self._log: Any = None

    def file(self, kind: str) -> Path:
        """The start file of a kind of target; of a reviewed run, its own file of corrections."""
        if self.reviewed is not None:
            return self.folder / f"corrections-{kind}{SUFFIXES[kind]}"
        if self.output is not None and kind == self.kind:
            return self.output
        beside = Path(self.source.path).parent
        return beside / f"{self.source.name}-{kind}{SUFFIXES[kind]}"

    def existing(self) -> dict[str, Any]:
        """The shapes of start files and their digests; of a run without corrections, its starts."""
        shapes: Shapes = []
        digests = {}
        for kind in SUFFIXES:
            path, found = self.file(kind), digest(self.file(kind))
            if found and found != self._old:
                shapes += read_start(path, kind, self.start)
                digests[kind] = found
            elif self.reviewed is not None and kind == self.kind:
                shapes += self._starts(self.reviewed)
        return {"items": shapes, "digests": digests}

    def _starts(self, run: Run) -> Shapes:
        """Where the objects of a run started; of whole tracks, their boxes in its first frame."""
        if self.given is None:
            return typed_start(run.table, run.start)
        shapes = [] if self.is_gone else read_start(self.given, self.kind, run.start)
        if not holds_whole_tracks({(shape["frame"], shape["name"]) for shape in shapes}):
            return shapes
        return [shape for shape in shapes if shape["frame"] == run.start]

    def _is_old(self, path: Path) -> bool:
        if self.reviewed is None or not path.is_file():
            return False
        if self.given is not None and self.given.resolve() == path.resolve():
            return False
        return path.stat().st_mtime < self.configuration.stat().st_mtime

    def command(self, kind: str, shapes: Shapes) -> list[str]:
        """Arguments of the command that tracks from the start file, as the reviewed run did."""
        frames, usual = {shape["frame"] for shape in shapes}, 0
        given = [] if kind == "boxes" else [kind]
        given += [str(self.video)]
        if self.reviewed is not None and kind == self.kind:
            given += ["--config", str(self.configuration)]
            usual = self.reviewed.start
        elif self.range:
            given += ["--range", ",".join(map(str, self.range))]
        given += [f"--{kind}", str(self.file(kind))]
        if usual not in frames:
            given += ["--start", str(min(frames))]
        return ["track", *given]

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
            Refusal: the file is not the one that the page has read, of which it gives the digest.
        """
        kind, shapes = content["kind"], content["items"]
        if kind not in SUFFIXES:
            raise InputError(f"there is no kind of target {kind!r:.60}; use {', '.join(SUFFIXES)}.")
        path = self.file(kind)
        if self.reviewed is not None and kind == self.kind:
            self._check_correction(self.reviewed.table, shapes)
        with self._saving:
            check_start(path, kind)
            found = digest(path)
            if content.get("digest", "") != found:
                raise Refusal(
                    409,
                    error=f"'{path}' was changed by another page or program.",
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
                raise Refusal(400, error=str(error), digest=digest(path)) from None
            command = shlex.join(["jaxpf", *self.command(kind, shapes)])
            return {"file": str(path), "command": command, "digest": digest(path)}

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
                f"the start file '{self.given}' of this run is no longer a file; put it back to "
                "correct the run."
            )
        if holds_whole_tracks({(shape["frame"], shape["name"]) for shape in shapes}):
            raise InputError(
                "an object has shapes in three frames in a row, which count as a finished track, "
                "not as corrections; delete some."
            )

    def track(self, content: Any) -> dict[str, str]:
        """Start the run of the drawn shapes, which goes on when the page or this program ends.

        Raises:
            Refusal: it would replace other results, or a run, and the page has not asked for that.
        """
        if not content.get("replaces") and (self.is_running or self._holds_results()):
            state = "A run is writing its" if self.is_running else "There are"
            raise Refusal(409, error=f"{state} results in '{self.folder}'.")
        if self.run is not None and self.run.poll() is None:
            self.run.terminate()  # it keeps what it has tracked
            self.run.wait()
        if self.is_running:
            raise InputError(f"another program is tracking into '{self.folder}'; wait for it.")
        if self.reviewed is not None:  # a run that was stopped may have removed it
            write_config(self.configuration, "track", self.reviewed.table)
        self.save(content)  # corrections are newer than the options of the run
        given = self.command(content["kind"], content["items"])
        self._log = tempfile.NamedTemporaryFile()  # noqa: SIM115
        self.run = subprocess.Popen(
            [sys.executable, "-m", "jaxpf", *given, "-o", str(self.folder), "--overwrite"],
            stdin=subprocess.DEVNULL,
            stdout=self._log,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
        return {"output": str(self.folder)}

    def _holds_results(self) -> bool:
        starts = {self.file(kind).name for kind in SUFFIXES}
        with report_os_errors("read", self.folder):
            return self.folder.is_dir() and any(
                not is_left_over(each) and each.name not in starts for each in self.folder.iterdir()
            )

    @property
    def configuration(self) -> Path:
        """The options of the reviewed run."""
        return self.folder / "run.toml"

    @property
    def is_running(self) -> bool:
        """Whether a run is going on, of this program or another."""
        return (self.run is not None and self.run.poll() is None) or is_locked(self.folder)

    def progress(self, content: Any) -> dict[str, Any]:
        """Whether the run goes on, and its last lines."""
        running, text = self.is_running, ""
        if self.run is not None:
            lines = Path(self._log.name).read_text(errors="replace").splitlines()
            text = "\n".join(lines[-_LINES:])
        return {
            "running": running,
            "text": text,
            "failed": self.run is not None and bool(self.run.poll()),
        }

    def how_to_end(self) -> str:
        """How the run that goes on is seen and ended."""
        end = f"  `kill {self.run.pid}` ends it, and keeps what it has tracked." if self.run else ""
        return f"The run goes on; `jaxpf view {shlex.quote(str(self.folder))}` shows it.{end}"


def digest(path: Path) -> str:
    """Of a file's content; "" if there is no file."""
    with report_os_errors("read", path):
        return hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else ""
