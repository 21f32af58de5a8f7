"""Writes playable video: H.264 in MP4."""

import math
import os
from contextlib import suppress
from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import Any

import cv2
import numpy as np

from jaxpf.contract.errors import InputError, import_extra
from jaxpf.files.writing import check_output_file

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

    Use it as a context manager.  The first frame replaces an earlier video.  The file can be played
    whenever the program ends: the frames written up to then form a video.  If encoding fails, no
    file is left.

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
        check_output_file(self.path, overwrite=True)
        self._av = import_extra("av", f"writing the video '{path}' needs PyAV")
        self.num_frames = 0
        self._shape, self._padding = (height, width), (height % 2, width % 2)
        self._rate = Fraction(fps).limit_denominator(60_000)
        self._period, self._latest = 1 / fps, -1
        self._aspect = Fraction(pixel_aspect).limit_denominator(1000)
        self._container: Any = None
        self._stream: Any = None
        self._error: InputError | None = None
        self._check_encoder()

    def _check_encoder(self) -> None:
        """Try the encoder, so that nothing is replaced if it will fail."""
        try:
            encoder = self._av.CodecContext.create(_ENCODER, "w")
            self._set_up(encoder)
            encoder.open()
        except (self._av.FFmpegError, ValueError) as error:
            height, width = self._shape
            raise InputError(
                f"cannot write video '{self.path}': the encoder {_ENCODER} is missing or refuses "
                f"frames of {width}x{height} pixels ({str(error).lower()}); install av from PyPI, "
                "or give frames of another size"
            ) from None

    def _set_up(self, context: Any) -> None:
        context.height, context.width = np.add(self._shape, self._padding).tolist()
        context.options, context.pix_fmt = _SETTINGS, "yuv420p"
        context.time_base, context.sample_aspect_ratio = _TICK, self._aspect
        context.colorspace, context.color_range = _BT601, _LIMITED

    def write(self, frame: np.ndarray, time: float | None = None) -> None:
        """Append one frame.

        Args:
            frame: uint8 RGB [height, width, 3]; the caller may change it afterwards.
            time: when to show it, seconds after the first; by default its number / ``fps``.

        Raises:
            InputError: the frame could not be encoded or written.
        """
        if any(self._padding):
            bottom, right = self._padding
            frame = cv2.copyMakeBorder(frame, 0, bottom, 0, right, cv2.BORDER_REPLICATE)
        time = self.num_frames * self._period if time is None else time
        self._latest = max(round(time / _TICK), self._latest + 1)
        self._encode(cv2.cvtColor(frame, cv2.COLOR_RGB2YUV_I420))
        self.num_frames += 1

    def close(self) -> None:
        """Finish the file; further calls do nothing.

        Raises:
            InputError: encoding or writing failed, for example on a full disk; no file is left.
        """
        try:
            if self._error is not None or self._container is not None:
                self._encode(None)
        finally:  # also after Ctrl-C while the encoder empties its queue
            self._release()

    def _encode(self, picture: np.ndarray | None) -> None:
        """Encode a picture; if it is None, finish the file.  After an error, fail again."""
        if self._error is not None:
            raise self._error
        try:
            if self._container is None:
                self._open()
            frame = None
            if picture is not None:
                frame = self._av.VideoFrame.from_ndarray(picture, "yuv420p")
                frame.pts, frame.time_base = self._latest, _TICK
                frame.duration = round(self._period / _TICK)
            self._container.mux(self._stream.encode(frame))
            if picture is None:
                self._container.close()
        except Exception as error:
            reason = (getattr(error, "strerror", None) or str(error)).lower()
            self._error = InputError(
                f"cannot write video '{self.path}': {reason}; check the free disk space"
            )
            self._release()
            self.path.unlink(missing_ok=True)
            raise self._error from error

    def _open(self) -> None:
        self.path.unlink(missing_ok=True)  # whoever reads an earlier video can go on
        self.path.touch()
        self._container = self._av.open(str(self.path.absolute()), "w", options=_CONTAINER)
        self._stream = self._container.add_stream(_ENCODER, rate=self._rate)
        self._set_up(self._stream.codec_context)

    def _release(self) -> None:
        if self._container is not None:
            with suppress(Exception):
                self._container.close()
            self._container = None

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
