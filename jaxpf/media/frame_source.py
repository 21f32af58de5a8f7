"""The interface of every source of frames: file, folder or camera."""

from collections.abc import Generator
from pathlib import Path

import cv2
import numpy as np

from jaxpf.contract.errors import InputError

#: Frames per second if the source does not specify it.
DEFAULT_FPS = 25.0


def announced(capture: cv2.VideoCapture) -> tuple[float | None, int | None]:
    """Frames per second and number of frames according to the container; None where unlikely."""
    fps, count = capture.get(cv2.CAP_PROP_FPS), capture.get(cv2.CAP_PROP_FRAME_COUNT)
    # Above 1000 it is the container's clock rate, not a frame rate.
    has_fps, has_count = 0 < fps <= 1000, 1 <= count < 1e9
    return fps if has_fps else None, int(count) if has_count else None


class FrameSource:
    """Frames of one video, read on demand; repeatedly, unless the source is live.

    Iterating decodes from the beginning and keeps no frame, so memory does not grow with the
    length.

    Attributes:
        path: the file or folder; for a live source its address as text, without a password.
        name: the file name without suffix, or the folder's name; results use it.
        is_live: whether frames come only once and their number is unknown beforehand.
        is_camera: whether, in addition, frames are dropped if they are not read in time.
        width: of every frame, pixels.
        height: of every frame, pixels.
        fps: frames per second; 25 for folders and if the container does not specify it.
        frames_expected: number of frames according to the container, often inexact; None if it
            gives none.
        num_frames: exact number of frames; None until known.  Folders know it at once, videos
            after a pass to the end.
        truncated: True once a pass has shown that the video is cut off or damaged: every
            decodable frame was yielded, and ``note`` describes the missing rest.
        note: one sentence to show the user, or None.
    """

    is_live = False
    is_camera = False

    def __init__(self, path: Path | str, name: str, fps: float | None):
        self.path = path
        self.name = name
        self.width = 0
        self.height = 0
        self.fps = DEFAULT_FPS if fps is None else fps
        self.frames_expected: int | None = None
        self.num_frames: int | None = None
        self.truncated = False
        self.note: str | None = None

    def frames(self, start: int = 0) -> Generator[np.ndarray]:
        """Yield the frames from number ``start`` (counting from 0) to the end.

        Frames before ``start`` are decoded and dropped, because seeking by timestamps lands on the
        wrong frame in many videos.

        Yields:
            uint8 RGB [H, W, 3]; each is a fresh array.

        Raises:
            InputError: ``start`` is negative or past the end, or a frame is unusable.
        """
        if start < 0:
            raise InputError(f"frame {start} of '{self.path}' is negative; frames count from 0")
        if self.num_frames is not None and start >= self.num_frames:
            raise self._past_the_end(start, self.num_frames)
        return self._frames(start)

    def shown_at(self, number: int) -> float:
        """Seconds after the first frame at which a frame that has been read is shown.

        The timestamp for a video, whose frame rate may vary; index / fps otherwise.
        """
        return number / self.fps

    def __iter__(self) -> Generator[np.ndarray]:
        return self.frames()

    def _frames(self, start: int) -> Generator[np.ndarray]:
        raise NotImplementedError

    def _past_the_end(self, start: int, count: int) -> InputError:
        return InputError(
            f"frame {start} is past the end of '{self.path}', which has {count} frame(s); "
            f"choose one from 0 to {count - 1}"
        )
