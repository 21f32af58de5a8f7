"""Results of ``jaxpf track`` for the page, as they are written."""

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from jaxpf.contract.errors import InputError

#: Most bytes of one answer, and the tables that are read.
_MOST, _TABLES = 4 * 2**20, ("tracks", "outlines")


class Run:
    """An output folder, which may still be written."""

    def __init__(self, folder: Path, table: Mapping[str, Any] | None = None):
        """Describe a run by its options; without ``table``, by its ``run.toml``."""
        if table is None:
            try:
                table = tomllib.loads((folder / "run.toml").read_text())["track"]
            except (OSError, KeyError, tomllib.TOMLDecodeError):
                raise InputError(
                    f"'{folder}' holds no run.toml of `jaxpf track`; give the folder of a run."
                ) from None
        self.folder, self.name, self.table = folder, str(folder), dict(table)
        self.video, self.kind = str(table.get("video", "")), table.get("target", "boxes")
        self.start = table.get("start", 0)
        file = table.get(self.kind)  # as its flag
        self.start_file = None if file is None else Path(file)

    def since(self, at: dict[str, int]) -> dict[str, Any]:
        """Whole lines of the tables after the bytes ``at``, and whether more may follow."""
        try:
            file = (self.folder / "tracks.csv").stat().st_ino
        except FileNotFoundError:
            file = 0
        is_new = at["file"] not in (0, file)  # another run has replaced it
        begin = {"tracks": 0, "outlines": 0} if is_new else at
        tracks, outlines = (self._lines(f"{name}.csv", begin[name]) for name in _TABLES)
        return {
            "tracks": tracks.decode(),
            "outlines": outlines.decode(),
            "at": {
                "file": file,
                "tracks": begin["tracks"] + len(tracks),
                "outlines": begin["outlines"] + len(outlines),
            },
            "is_new": is_new,
            "running": bool(tracks) or not (self.folder / "summary.json").exists(),
        }

    def _lines(self, name: str, begin: int) -> bytes:
        try:
            with open(self.folder / name, "rb") as file:
                file.seek(begin)
                text = file.read(_MOST)
        except FileNotFoundError:
            return b""
        return text[: text.rfind(b"\n") + 1]
