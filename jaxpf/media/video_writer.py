"""Writing a playable WebM video."""

import math
import os
from pathlib import Path
from types import TracebackType

import cv2
import numpy as np

from jaxpf.errors import InputError
from jaxpf.files.writing import report_os_errors, temporary_sibling
from jaxpf.media.quiet import quiet_opencv, quiet_stderr

_FOURCC = {"vp9": "VP90", "vp8": "VP80"}


class VideoWriter:
    """Write frames to a ``.webm`` file, which every browser plays.

    Use it as a context manager.  The video grows under a temporary name in the same folder
    and gets its own name when it is closed, also when Ctrl-C or an error ends the block: the
    frames written so far are then a playable video.  Without any frame no file is left.

    VP9 compresses better, VP8 is about four times as fast to encode.  Where OpenCV lacks the
    asked codec the other one is taken; ``codec`` tells which.

    Attributes:
        path: the final name.
        codec: ``"vp9"`` or ``"vp8"``, the one in use.
        num_frames: how many frames were written.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        width: int,
        height: int,
        fps: float,
        codec: str = "vp9",
    ):
        """Open the video.

        Args:
            path: ends in ``.webm``; its folder must exist; an existing file is replaced.
            width: of the frames, pixels.  Odd sizes are padded to even ones by repeating the
                last column or row, because these codecs cannot store them.
            height: of the frames, pixels.
            fps: frames per second.
            codec: ``"vp9"`` or ``"vp8"``.

        Raises:
            InputError: the name, the rate or the folder cannot be used, or no codec is there.
        """
        self.path = Path(path)
        if self.path.suffix.lower() != ".webm":
            raise InputError(f"video '{path}' must end in .webm; rename the output")
        if not (math.isfinite(fps) and 0 < fps <= 1000):
            raise InputError(f"fps {fps} for '{path}' is not between 0 and 1000; give one like 25")
        if width < 1 or height < 1:
            raise ValueError(f"frames of {width}x{height} pixels cannot be written")
        if codec not in _FOURCC:
            raise ValueError(f"codec is one of {sorted(_FOURCC)}, not {codec!r}")
        self.num_frames = 0
        self._shape = (height, width, 3)
        self._padding = (height % 2, width % 2)
        self._temporary = temporary_sibling(self.path)
        # Tried by hand first: OpenCV does not say why it cannot open a file.
        with report_os_errors("write", self.path):
            self._temporary.touch()
        self._writer, self.codec = self._open(codec, fps)

    def _open(self, codec: str, fps: float) -> tuple[cv2.VideoWriter, str]:
        size = (self._shape[1] + self._padding[1], self._shape[0] + self._padding[0])
        for name in sorted(_FOURCC, key=lambda name: name != codec):
            # OpenCV prints that WebM knows no such tag, then writes a correct file.
            with quiet_opencv(), quiet_stderr():
                fourcc = cv2.VideoWriter.fourcc(*_FOURCC[name])
                writer = cv2.VideoWriter(str(self._temporary), cv2.CAP_FFMPEG, fourcc, fps, size)
            if writer.isOpened():
                return writer, name
        self._temporary.unlink(missing_ok=True)
        raise InputError(
            f"cannot write video '{self.path}': this OpenCV has neither the VP9 nor the VP8 "
            "encoder; install opencv-python-headless from PyPI"
        )

    def write(self, frame: np.ndarray) -> None:
        """Append one frame, uint8 RGB [height, width, 3]."""
        if frame.shape != self._shape or frame.dtype != np.uint8:
            raise ValueError(
                f"expected a uint8 frame of shape {self._shape}, got {frame.dtype} {frame.shape}"
            )
        frame = cv2.cvtColor(frame, cv2.COLOR_RGB2BGR)
        if any(self._padding):
            bottom, right = self._padding
            frame = cv2.copyMakeBorder(frame, 0, bottom, 0, right, cv2.BORDER_REPLICATE)
        self._writer.write(frame)
        self.num_frames += 1

    def close(self) -> None:
        """Finish the file and give it its name; further calls do nothing.

        Raises:
            InputError: the file is incomplete, as on a full disk.
        """
        if not self._writer.isOpened():
            return
        try:
            with quiet_opencv():
                self._writer.release()
        finally:
            # Reached also when Ctrl-C strikes again while the encoder empties its queue.
            if self.num_frames == 0:
                self._temporary.unlink(missing_ok=True)
            else:
                with report_os_errors("write", self.path):
                    os.replace(self._temporary, self.path)
        if self.num_frames and not _ends_with_frame(self.path, self.num_frames - 1):
            if self.path.stat().st_size == 0:
                self.path.unlink()
            raise InputError(
                f"video '{self.path}' is incomplete: its last frames cannot be read back; check "
                "the free disk space"
            )

    def __enter__(self) -> "VideoWriter":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            self.close()
        except InputError:
            # The error that ended the block matters more than the state of the video.
            if error is None:
                raise


def _ends_with_frame(path: Path, last: int) -> bool:
    """True if frame ``last`` decodes; encoders do not report a failed write."""
    with quiet_opencv():
        capture = cv2.VideoCapture(str(path))
        try:
            capture.set(cv2.CAP_PROP_POS_FRAMES, last)
            return bool(capture.grab())
        finally:
            capture.release()
