"""Frames as they come: cameras, streams and pipes, read once, by a thread of their own."""

import collections
import math
import os
import re
import threading
import time
from collections.abc import Generator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import cv2
import numpy as np

from jaxpf.contract.errors import InputError
from jaxpf.media.frame_source import FrameSource
from jaxpf.media.images import to_rgb
from jaxpf.media.quiet import quiet_opencv

# Two letters at least, or it is a drive.
_URL = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+://")
#: How long a stream may be silent, milliseconds, while it is opened and afterwards.
_PATIENCE = 10_000
#: Frames of a stream that may wait for whoever reads: a thread's uneven pace, little memory.
_WAITING = 4
#: Seconds between two looks at whether Ctrl-C was pressed, where waiting cannot be interrupted.
_LOOK = 0.2


def live_address(source: str | os.PathLike[str] | int) -> str | int | None:
    """A camera's index, or the address of a stream, a device or a pipe; None for anything else."""
    if isinstance(source, int):
        return source
    text = os.fspath(source)
    if _URL.match(text):
        return text
    path = Path(text)
    if path.is_fifo() or _is_camera(path):
        return text
    # More digits than any index has are the name of a file that is missing.
    if text.isdecimal() and len(text) < 10 and not path.exists():
        return int(text)
    return None


class LiveSource(FrameSource):
    """Frames of a camera, a stream or a pipe, which come once.

    A thread reads them, so that Ctrl-C is answered while nothing comes.  A stream's frames and a
    pipe's wait to be read.  A camera's do not: whoever asks gets the latest one.

    Attributes:
        num_left_out: how many frames of a camera nobody asked for in time.
    """

    is_live = True

    def __init__(self, address: str | int, fps: float | None):
        """Open it, and wait for its first frame.

        Args:
            address: see ``live_address``.
            fps: see ``jaxpf.media.open_frames``.

        Raises:
            InputError: it does not open, or gives no picture.
        """
        shown, name = _names(address)
        super().__init__(shown, name, fps)
        self.is_camera = isinstance(address, int) or _is_camera(Path(address))
        self._noun = "camera" if self.is_camera else "stream"
        self._address, self._fps_given = address, fps
        self.num_left_out = 0
        self._waiting: collections.deque[np.ndarray] = collections.deque()
        self._news = threading.Condition()
        self._opened = self._ended = self._closed = self._begun = self._silent = False
        self._error: Exception | None = None
        # A daemon: a source that has fallen silent must not keep the program from ending.
        threading.Thread(target=self._read_all, daemon=True).start()
        try:
            frame = self._next()
            if frame is None:
                raise self._no_picture()
        except BaseException:
            self.close()
            raise
        self.height, self.width = frame.shape[:2]
        self._first: np.ndarray | None = frame

    def close(self) -> None:
        """Let go of it; further calls do nothing."""
        with self._news:
            self._closed = True
            self._news.notify_all()

    def _frames(self, start: int) -> Generator[np.ndarray]:
        if self._begun:
            raise InputError(f"the frames of {self._noun} '{self.path}' come once; open it again")
        self._begun = True
        count, frame = 0, self._first
        self._first = None
        try:
            while frame is not None:
                if frame.shape[:2] != (self.height, self.width):
                    raise InputError(
                        f"{self._noun} '{self.path}' changes its size at frame {count}, from "
                        f"{self.width}x{self.height} to {frame.shape[1]}x{frame.shape[0]}; send "
                        "one size"
                    )
                count += 1
                if count > start:
                    yield frame
                frame = self._next()
            self.num_frames = count
            self._compare(count)
            if count <= start:
                raise self._past_the_end(start, count)
        finally:
            self.close()
            if self.num_left_out:
                self.note = (
                    f"{self.num_left_out} frames of {self._noun} '{self.path}' came while others "
                    "were tracked, and were left out; fewer particles or --no-overlay may keep up"
                )

    def _compare(self, count: int) -> None:
        expected = self.frames_expected
        if expected is not None and count < expected - max(2, expected // 100):
            self.truncated = True
            self.note = (
                f"stream '{self.path}' announces {expected} frames, and {count} came: it broke "
                f"off after frame {count - 1}"
            )
        elif self._silent:
            self.note = (
                f"stream '{self.path}' sent nothing for {_PATIENCE / 1000:g} s after frame "
                f"{count - 1}, and was taken to have ended"
            )

    def _next(self) -> np.ndarray | None:
        """The next frame, or None after the last one."""
        with self._news:
            while not (self._waiting or self._ended):
                self._news.wait(_LOOK)
            if not self._waiting:
                if self._error is not None:
                    raise self._error
                return None
            frame = self._waiting.popleft()
            self._news.notify_all()
            return frame

    def _read_all(self) -> None:
        """The thread."""
        try:
            with quiet_opencv():
                capture = _capture(self._address)
            try:
                if capture.isOpened():
                    self._describe(capture)
                    self._opened = True
                    self._read_frames(capture)
            finally:
                capture.release()
        except Exception as error:  # reaches whoever waits for a frame
            self._error = error
        finally:
            with self._news:
                self._ended = True
                self._news.notify_all()

    def _describe(self, capture: Any) -> None:
        fps = capture.get(cv2.CAP_PROP_FPS)
        # Above 1000 it is the clock rate of the container, not a frame rate.
        if self._fps_given is None and math.isfinite(fps) and 0 < fps <= 1000:
            self.fps = fps
        count = capture.get(cv2.CAP_PROP_FRAME_COUNT)
        if not self.is_camera and math.isfinite(count) and 1 <= count < 1e9:
            self.frames_expected = int(count)

    def _read_frames(self, capture: Any) -> None:
        while not self._closed:
            asked = time.monotonic()
            with quiet_opencv():
                decoded, frame = capture.read()
            patient = time.monotonic() - asked > 0.9 * _PATIENCE / 1000
            # A last frame that came in part is decoded when patience is over, and the end follows.
            self._silent = patient or (self._silent and not decoded)
            if not decoded:
                return
            frame = to_rgb(frame, self.path)
            with self._news:
                while len(self._waiting) >= _WAITING and not (self.is_camera or self._closed):
                    self._news.wait()
                if self.is_camera and self._waiting:
                    self._waiting.clear()
                    self.num_left_out += 1
                self._waiting.append(frame)
                self._news.notify_all()

    def _no_picture(self) -> InputError:
        if self.is_camera:
            does = "opens but gives no picture" if self._opened else "does not open"
            index = "; cameras count from 0" if isinstance(self._address, int) else ""
            return InputError(
                f"camera '{self.path}' {does}; check that it is plugged in, that you may use it "
                f"and that no other program does{index}"
            )
        does = "sends no picture that OpenCV can decode" if self._opened else "does not open"
        if isinstance(self._address, str) and _URL.match(self._address):
            check = "check the address, that it is being sent, and that OpenCV knows its protocol"
        else:
            check = "check what is written into it: a format that streams, of a known protocol"
        return InputError(f"stream '{self.path}' {does}; {check} and codec")


def _capture(address: str | int) -> Any:
    if isinstance(address, str) and _URL.match(address):
        patience = [cv2.CAP_PROP_OPEN_TIMEOUT_MSEC, _PATIENCE]
        patience += [cv2.CAP_PROP_READ_TIMEOUT_MSEC, _PATIENCE]
        return cv2.VideoCapture(address, cv2.CAP_FFMPEG, patience)
    if isinstance(address, str) and Path(address).is_fifo():
        # Another backend would open the pipe again, and wait for a writer who has come and gone.
        return cv2.VideoCapture(address, cv2.CAP_FFMPEG)
    return cv2.VideoCapture(address)


def _is_camera(path: Path) -> bool:
    """Whether a path is a camera's device, as Linux names them."""
    return path.is_char_device() and path.resolve().name.startswith("video")


def _names(address: str | int) -> tuple[str, str]:
    """An address without a password, and a name for results."""
    if isinstance(address, int):
        return f"{address}", f"camera-{address}"
    if not _URL.match(address):
        return address, Path(address).stem
    try:
        parts = urlsplit(address)
    except ValueError as error:
        raise InputError(f"'{address}' is no address of a stream: {error}") from None
    user, at, host = parts.netloc.rpartition("@")
    user = f"{user.partition(':')[0]}:***" if ":" in user else user
    name = Path(parts.path).stem or host.partition(":")[0] or parts.scheme
    return parts._replace(netloc=f"{user}{at}{host}").geturl(), name
