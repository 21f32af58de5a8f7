"""Writes playable video: H.264 in MP4."""

import math
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import Any

import cv2
import numpy as np

from jaxpf.contract.errors import InputError, import_extra
from jaxpf.files.writing import report_os_errors, temporary_sibling

# With this preset a 640x480 frame takes 2 ms on one core, and a file half as large again as with
# "superfast", which takes 5 ms; "crf" fixes the quality whatever the file size.
_ENCODER, _SETTINGS = "libx264", {"preset": "ultrafast", "crf": "22"}
# The index grows with every frame, so that the video can be played even if the program is killed;
# on closing it becomes one, which every player reads.
_CONTAINER = {"movflags": "+hybrid_fragmented+frag_every_frame", "flush_packets": "1"}
#: Unit of times in seconds; divides the usual frame rates.
_TICK = Fraction(1, 90_000)
# Lowest frame rate; containers cannot store much longer frame durations.
_SLOWEST = 0.0001
# ITU-T H.273: BT.601 with values from 16 to 235, as OpenCV's conversion produces.
_BT601, _LIMITED = 6, 1


class VideoWriter:
    """Writes frames to a ``.mp4`` file (H.264), which every browser and player supports.

    Use it as a context manager.  The video gets its name, and replaces an earlier one, with its
    first frame.  It can be played whenever the program ends: the frames written up to then form a
    video.  If there are no frames, or encoding fails, no file is left.

    Attributes:
        path: the final name.
        num_frames: number of frames written.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        width: int,
        height: int,
        fps: float,
        pixel_aspect: Fraction | float = 1,
    ):
        """Open the video.

        Args:
            path: ends in ``.mp4``; its folder must exist; an existing file is replaced.
            width: of the frames, pixels.  Odd sizes are padded to even ones by repeating the
                last column or row, because the codec requires even sizes.
            height: of the frames, pixels.
            fps: frames per second.
            pixel_aspect: width of a pixel over its height, as players show it.

        Raises:
            InputError: the name, rate or folder is unusable, or the codec is missing.
        """
        self.path = Path(path)
        if self.path.suffix.lower() != ".mp4":
            raise InputError(f"video '{path}' must end in .mp4; rename the output")
        if not (math.isfinite(fps) and _SLOWEST <= fps <= 1000):
            raise InputError(
                f"fps {fps} for '{path}' is not between {_SLOWEST} and 1000; give one like 25"
            )
        self._period, self._latest = 1 / fps, -1
        self.num_frames = 0
        self._shape = (height, width, 3)
        self._padding = (height % 2, width % 2)
        self._temporary = temporary_sibling(self.path)
        self._error: Exception | None = None
        self._closed = False
        with report_os_errors("write", self.path):
            self._temporary.touch()
        try:
            rate = Fraction(fps).limit_denominator(60_000)
            aspect = Fraction(pixel_aspect).limit_denominator(1000)
            self._container, self._stream = self._open(rate, aspect)
        except BaseException:
            self._temporary.unlink(missing_ok=True)
            raise

    def _open(self, rate: Fraction, pixel_aspect: Fraction) -> tuple[Any, Any]:
        av = import_extra("av", f"writing the video '{self.path}' needs PyAV")
        try:
            av.codec.Codec(_ENCODER, "w")
            container = av.open(str(self._temporary.absolute()), "w", options=_CONTAINER)
            stream: Any = container.add_stream(_ENCODER, rate=rate)
            stream.height, stream.width = np.add(self._shape[:2], self._padding).tolist()
            stream.options = _SETTINGS
            stream.pix_fmt = "yuv420p"
            context = stream.codec_context
            context.time_base, context.sample_aspect_ratio = _TICK, pixel_aspect
            context.colorspace, context.color_range = _BT601, _LIMITED
            context.open()
        except av.codec.codec.UnknownCodecError:
            raise InputError(
                f"cannot write video '{self.path}': the encoder {_ENCODER} is missing here; "
                "install av from PyPI"
            ) from None
        except av.FFmpegError as error:
            raise InputError(
                f"cannot write video '{self.path}': the encoder {_ENCODER} refuses frames of "
                f"{self._shape[1]}x{self._shape[0]} pixels ({str(error.strerror).lower()}); give "
                "frames of another size"
            ) from None
        return container, stream

    def write(self, frame: np.ndarray, time: float | None = None) -> None:
        """Append one frame.

        Args:
            frame: uint8 RGB [height, width, 3]; the caller may change it afterwards.
            time: when to show it, seconds after the first; by default its number / ``fps``.

        Raises:
            InputError: a frame could not be encoded or written.
        """
        if any(self._padding):
            bottom, right = self._padding
            frame = cv2.copyMakeBorder(frame, 0, bottom, 0, right, cv2.BORDER_REPLICATE)
        time = self.num_frames * self._period if time is None else time
        self._latest = max(round(time / _TICK), self._latest + 1)
        with self._reported():
            self._encode(cv2.cvtColor(frame, cv2.COLOR_RGB2YUV_I420))
        self.num_frames += 1
        if self._temporary.exists():
            with suppress(OSError):  # Windows renames no open file; ``close`` does
                os.replace(self._temporary, self.path)

    def close(self) -> None:
        """Finish the file and rename it to its final name; further calls do nothing.

        Raises:
            InputError: encoding or writing failed, for example on a full disk; no file is left.
        """
        if self._closed:
            return
        self._closed = True
        try:
            with self._reported():
                if self.num_frames:
                    self._encode(None)
                self._container.close()
        finally:  # also after Ctrl-C while the encoder empties its queue
            with suppress(Exception):
                self._container.close()
            self._give_name()

    def _give_name(self) -> None:
        if self._error is not None or not self.num_frames:
            self._temporary.unlink(missing_ok=True)
            if self.num_frames:
                self.path.unlink(missing_ok=True)
        elif self._temporary.exists():
            with report_os_errors("write", self.path):
                os.replace(self._temporary, self.path)

    @contextmanager
    def _reported(self) -> Iterator[None]:
        """Turn an error of the block into one sentence, with which later blocks fail, too."""
        if self._error is None:
            try:
                yield
                return
            except Exception as error:
                self._error = error
        reason = (getattr(self._error, "strerror", None) or str(self._error)).lower()
        raise InputError(
            f"cannot write video '{self.path}': {reason}; check the free disk space"
        ) from self._error

    def _encode(self, picture: np.ndarray | None) -> None:
        """Encode a picture, or flush the encoder if it is None."""
        import av

        frame = None if picture is None else av.VideoFrame.from_ndarray(picture, "yuv420p")
        if frame is not None:
            frame.pts, frame.time_base = self._latest, _TICK
            frame.duration = round(self._period / _TICK)
        self._container.mux(self._stream.encode(frame))

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
