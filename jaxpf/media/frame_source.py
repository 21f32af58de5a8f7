"""The interface of every source of frames: file, folder or camera."""

from collections.abc import Generator
from fractions import Fraction
from pathlib import Path

import numpy as np

from jaxpf.contract.errors import InputError
from jaxpf.media.clock import Clock

#: Frames per second if the source does not specify it.
DEFAULT_FPS = 25.0


class FrameSource:
    """Frames of one video, read on demand; repeatedly, unless the source is live.

    Iterating decodes from the beginning and keeps no frame, so memory does not grow with the
    length.

    Attributes:
        path: the file or folder; for a live source its address as text, without a password.
        name: the file name without suffix, or the folder's name; results use it.
        is_live: whether frames come only once and their number is unknown beforehand.
        width: of every frame, pixels.
        height: of every frame, pixels.
        pixel_aspect: width of a pixel over its height.  Coordinates count pixels, whatever their
            shape.
        frames_expected: number of frames according to the container, often inexact; None if it
            gives none.
        num_frames: exact number of frames; None until known.  Folders know it at once, videos
            after a pass to the end.
        pictures: the file names of a folder's frames; None for other sources.
        truncated: True once a pass has shown that the video is cut off: every decodable frame was
            yielded, and ``note`` describes the missing rest.
        note: one sentence to show the user, or None.
    """

    is_live = False

    def __init__(self, path: Path | str, name: str, fps: float | None):
        self.path = path
        self.name = name
        self.width = 0
        self.height = 0
        self.pixel_aspect = Fraction(1)
        self._given_fps = fps
        self._clock = Clock(DEFAULT_FPS)
        self.frames_expected: int | None = None
        self.num_frames: int | None = None
        self.pictures: list[str] | None = None
        self.truncated = False
        self.note: str | None = None

    @property
    def fps(self) -> float:
        """Frames per second: as given, else by the time stamps of the latest pass, or 25.

        It is a mean without pauses; ``shown_at`` has the time of each frame.
        """
        return self._given_fps or self._clock.rate

    def frames(self, start: int = 0) -> Generator[np.ndarray]:
        """Yield the frames from number ``start`` (counting from 0) to the end.

        Frames before ``start`` are decoded and dropped, because seeking by timestamps lands on the
        wrong frame in many videos.

        Yields:
            uint8 RGB [H, W, 3]; each is a fresh array.

        Raises:
            InputError: ``start`` is past the end, or a frame is unusable.
        """
        if self.num_frames is not None and start >= self.num_frames:
            raise self._past_the_end(start, self.num_frames)
        return self._frames(start)

    def count_frames(self) -> int:
        """The number of frames, found by decoding the video once if its header has no count.

        If that takes long and the header gives the duration, the number is an estimate.
        """
        return self.num_frames or self.frames_expected or 1

    def shown_at(self, number: int) -> float:
        """Seconds after the first frame at which a frame that has been read is shown.

        By the time stamps of a video, whose frame rate may vary; number / fps for a folder, or if
        ``fps`` was given.
        """
        if self._given_fps or number >= len(self._clock):
            return number / self.fps
        return self._clock[number]

    def __iter__(self) -> Generator[np.ndarray]:
        return self.frames()

    def _frames(self, start: int) -> Generator[np.ndarray]:
        raise NotImplementedError

    def _past_the_end(self, start: int, count: int) -> InputError:
        return InputError(
            f"frame {start} is past the end of '{self.path}', which has {count} frame(s); "
            f"choose one from 0 to {count - 1}"
        )

    def _check_size(self, picture: np.ndarray, number: int) -> None:
        height, width = picture.shape[:2]
        if (height, width) != (self.height, self.width):
            raise InputError(
                f"'{self.path}' changes its size at frame {number}, from "
                f"{self.width}x{self.height} to {width}x{height}; convert it to one size"
            )
