"""The page within a notebook."""

import os
from collections.abc import Generator, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from jaxpf.contract.errors import check_known
from jaxpf.media.page.runs import Run
from jaxpf.media.page.server import Server
from jaxpf.media.read import open_frames

#: Height of the page in a notebook, pixels.
_HEIGHT = 720


class Drawn:
    """A page shown in a notebook, and what is drawn on it so far.

    A notebook shows the page if the object is the last value of a cell.

    Attributes:
        shapes: what is drawn: a dictionary for each shape, with ``name``, ``frame`` and its
            coordinates in pixels.
        url: address of the page, to open it in a window of its own.
    """

    def __init__(self, source: Any, runs: Sequence[Run] = (), **about: Any):
        self.shapes: list[dict[str, Any]] = []
        answers = {
            "about": lambda _: {"items": self.shapes},
            "save": self._save,
            "progress": lambda content: {"running": False, "text": "", "failed": False},
            "result": lambda content: runs[content["index"]].since(content["at"]),
        }
        self._server = Server(source, answers, results=[run.name for run in runs], **about)
        self.url = self._server.url

    def _save(self, content: Any) -> dict[str, str]:
        self.shapes = content["items"]
        return {"file": "" if not self.shapes else "what is drawn", "command": ""}

    def _repr_html_(self) -> str:
        return f'<iframe src="{self.url}" width="100%" height="{_HEIGHT}"></iframe>'

    @property
    def names(self) -> list[str]:
        """Names of the shapes."""
        return [shape["name"] for shape in self.shapes]

    @property
    def boxes(self) -> np.ndarray:
        """x, y, w, h of the boxes in pixels, ``[P, 4]``, as for ``jaxpf.boxes.tracker``."""
        return self._columns("xywh")

    @property
    def points(self) -> np.ndarray:
        """x, y of the points in pixels, ``[P, 2]``, as for ``jaxpf.points.tracker``."""
        return self._columns("xy")

    def _columns(self, keys: str) -> np.ndarray:
        rows = [[shape[key] for key in keys] for shape in self.shapes if keys[-1] in shape]
        return np.array(rows, float).reshape(-1, len(keys))

    def close(self) -> None:
        """Close the page."""
        self._server.close()


def mark(frames: ArrayLike | str | os.PathLike[str], kind: str = "boxes") -> Drawn:
    """Draw start shapes in a notebook.

    ``drawn = jaxpf.media.mark(frames); drawn`` shows the page; ``drawn.boxes`` holds the boxes.

    Args:
        frames: uint8 RGB ``[T, H, W, 3]``, one frame ``[H, W, 3]``, or the path of a video or a
            folder of images.
        kind: ``"boxes"``, ``"points"``, ``"parts"`` or ``"contours"``.

    Raises:
        InputError: the frames cannot be read, or there is no such kind.
    """
    check_known("kind=", kind, ("boxes", "points", "parts", "contours"))
    if isinstance(frames, str | os.PathLike):
        return Drawn(open_frames(frames), kind=kind)
    whole = np.asarray(frames)
    whole = whole[None] if whole.ndim == 3 else whole

    def from_number(start: int) -> Generator[np.ndarray]:
        yield from whole[start:]

    count, height, width = whole.shape[:3]
    size = {"width": width, "height": height, "fps": 25.0, "num_frames": count}
    source = SimpleNamespace(name="frames", path="frames", frames=from_number, **size)
    return Drawn(source, kind=kind)


def view(folder: str | os.PathLike[str]) -> Drawn:
    """Review an output folder of ``jaxpf track`` in a notebook.

    Args:
        folder: the output folder, finished or still being written.

    Raises:
        InputError: the folder holds no run, or its film cannot be read.
    """
    run = Run(Path(folder))
    source = open_frames(run.video, range=run.table.get("range"))
    return Drawn(source, [run], kind=run.kind, start=run.start, can_draw=False)
