"""What every source of frames is, whether a file, a folder or a camera."""

from collections.abc import Generator
from pathlib import Path

import numpy as np

from jaxpf.contract.errors import InputError

#: Frames per second where nothing says.
DEFAULT_FPS = 25.0


class FrameSource:
    """Frames of one video, read as they are asked for; any number of times, unless it is live.

    Iterating decodes from the beginning and keeps no frame: memory does not grow with the
    length.

    Attributes:
        path: the file or folder; of a live source its address as text, without a password.
        name: the file name without suffix, or the name of the folder; what results are called by.
        is_live: whether frames come once, and nobody knows beforehand how many.
        is_camera: whether, besides, they wait for nobody.
        width: of every frame, pixels.
        height: of every frame, pixels.
        fps: frames per second; 25 if the container does not say, and for folders.
        frames_expected: how many frames the container announces.  An estimate: containers
            round, guess and lie.  None if it does not say.
        num_frames: the exact number of frames; None until it is known.  Folders know it at
            once, videos after a pass to the end.
        truncated: True once a pass has shown that the video is cut off or damaged: every
            frame that decodes was yielded, and ``note`` says what is missing.
        note: one sentence that is worth telling the user, or None.
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

        Frames before ``start`` are decoded and dropped: jumping by time stamps lands on the
        wrong frame in many videos.

        Yields:
            uint8 RGB [H, W, 3]; each is a fresh array.

        Raises:
            InputError: ``start`` is negative or past the end, or a frame cannot be used.
        """
        if start < 0:
            raise InputError(
                f"start frame {start} of '{self.path}' is negative; frames count from 0"
            )
        if self.num_frames is not None and start >= self.num_frames:
            raise self._past_the_end(start, self.num_frames)
        return self._frames(start)

    def times(self, count: int) -> np.ndarray:
        """Seconds ``[count]`` from the first frame at which each of the first frames is shown.

        The timestamps of a video, whose frame rate may vary; else index / fps.
        """
        return np.arange(count) / self.fps

    def __iter__(self) -> Generator[np.ndarray]:
        return self.frames()

    def _frames(self, start: int) -> Generator[np.ndarray]:
        raise NotImplementedError

    def _past_the_end(self, start: int, count: int) -> InputError:
        return InputError(
            f"start frame {start} is past the end of '{self.path}', which has {count} frame(s); "
            f"choose one from 0 to {count - 1}"
        )
