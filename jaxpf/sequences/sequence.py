"""A recorded sequence with its annotation, and the part of it on which trackers run."""

import dataclasses
from collections.abc import Sequence as Many
from pathlib import Path
from typing import Any

import numpy as np

from jaxpf.contract.errors import InputError
from jaxpf.contract.numbers import check_whole
from jaxpf.media.film import DEFAULT_FPS
from jaxpf.sequences.frames import Frames
from jaxpf.sequences.tables import BoxTable, dense, listed
from scenes import Scene, cut_patch

#: Maximum size in bytes of pictures kept in memory; longer sequences are read on demand.
MOST_KEPT = 512 * 2**20


@dataclasses.dataclass(frozen=True, eq=False)
class Sequence:
    """A recorded sequence.

    Attributes:
        path: its folder.
        frames: ``[T, H, W, 3]`` uint8, RGB, decoded on demand.
        truth: the annotated boxes that count, by id and frame.
        fps: frames per second.
        name: by default that of the folder.
        of_points: whether the boxes are windows around annotated points.
    """

    path: Path
    frames: Frames
    truth: BoxTable
    fps: float = DEFAULT_FPS
    name: str = ""
    of_points: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "name", self.name or self.path.resolve().name)
        last = max(self.truth.frame, default=-1)
        if not 0 <= last < len(self.frames):
            state = "no box that counts" if last < 0 else f"a box in frame {last} (from 0)"
            raise InputError(
                f"{self.truth.source} has {state}, and the sequence has {len(self.frames)} frames; "
                "correct one of them"
            )

    @property
    def num_frames(self) -> int:
        """T, the number of frames."""
        return len(self.frames)

    @property
    def ids(self) -> tuple[int, ...]:
        """The numbers of the P objects, ascending."""
        return tuple(np.unique(self.truth.id).tolist())

    @property
    def boxes(self) -> np.ndarray:
        """``[T, P, 4]``, x, y, w, h in pixels; NaN where an object has no box."""
        return dense(self.truth, self.ids, len(self.frames))

    @property
    def occlusion(self) -> np.ndarray:
        """``[T, P]``: 0 visible, 1 partly hidden, 2 mostly hidden, -1 unknown or absent."""
        found = np.full((len(self.frames), len(self.ids)), -1)
        columns = np.searchsorted(self.ids, self.truth.id)
        found[self.truth.frame, columns] = self.truth.occlusion
        return found

    def scene(
        self,
        ids: Many[int] | None = None,
        start_frame: int | None = None,
        num_frames: int | None = None,
    ) -> Scene:
        """Return the part of the sequence that starts where all its objects are in view.

        A box is in view if it covers at least one pixel of the picture.  Boxes that extend beyond
        the picture stay whole; their reference patch is the part inside.

        Args:
            ids: the objects, in this order; by default all objects in view in the start frame or,
                if none is given, in the first frame with any object, in the order of the file.
            start_frame: counting from 0; by default the first frame with all ``ids`` in view.
            num_frames: number of frames from the start; by default all.

        Returns:
            A scene that begins with the start frame, with patches cut there.  ``extras`` holds
            ``ids [P]``, ``start_frame``, ``source`` (the folder) and ``occlusion [T, P]``.

        Raises:
            InputError: unknown or repeated ids, objects that are not in view in the start frame,
                or frames that the sequence lacks.
        """
        known, boxes, in_view = self.ids, self.boxes, self._in_view()
        wanted = list(known if ids is None else ids)
        if not wanted or len(set(wanted)) < len(wanted) or not set(wanted) <= set(known):
            raise InputError(
                f"sequence {self.name!r} cannot start with the ids {wanted}; name each once, among "
                f"{listed(known)}"
            )
        columns = [known.index(number) for number in wanted]
        together = in_view[:, columns].any(axis=1) if ids is None else in_view[:, columns].all(1)
        start = int(np.argmax(together)) if start_frame is None else start_frame
        check_whole("start_frame", start, 0, len(boxes) - 1)
        if not together[start]:
            seen = (f"{known[c]} in {listed(np.flatnonzero(in_view[:, c]))}" for c in columns)
            raise InputError(
                f"sequence {self.name!r} cannot start in frame {start}; its objects are in view in "
                f"the frames: {'; '.join(seen)[:500]}"
            )
        if ids is None:
            there = self.truth.id[self.truth.frame == start].tolist()
            columns = [c for c in map(known.index, there) if in_view[start, c]]
        length = len(boxes) - start if num_frames is None else num_frames
        check_whole("num_frames", length, 1, len(boxes) - start)
        part = slice(start, start + length)
        lazy = self.frames[part]
        frames = np.asarray(lazy) if lazy.nbytes <= MOST_KEPT else lazy
        chosen, truth = [known[column] for column in columns], boxes[part, columns]
        extras: dict[str, Any] = {"occlusion": self.occlusion[part, columns]}
        if self.of_points:
            extras["points"] = truth[..., :2] + truth[..., 2:] / 2
            extras["visible"] = np.isfinite(truth).all(axis=-1)
            extras["point_names"] = tuple(map(str, chosen))
        about = {"source": str(self.path), "ids": tuple(chosen), "start_frame": start}
        return Scene(
            name=self.name,
            frames=frames,
            boxes=truth,
            patches=[cut_patch(frames[0], box) for box in truth[0]],
            fps=self.fps,
            parameters={**about, "num_frames": length},
            extras={**about, "ids": np.array(chosen, dtype=int), **extras},
            settings={},
        )

    def _in_view(self) -> Any:
        """``[T, P]`` bool: whether a box covers at least one pixel, rounded as in ``cut_patch``."""
        low, extent = np.split(self.boxes, 2, axis=-1)
        size = self.frames.shape[2:0:-1]
        start, end = np.clip(np.rint(low), 0, size), np.clip(np.rint(low + extent), 0, size)
        return np.all(end > start, axis=-1)  # false where NaN
