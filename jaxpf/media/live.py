"""Live frames of cameras, streams and pipes, read once, in a separate thread."""

import collections
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
from jaxpf.contract.numbers import check_whole
from jaxpf.media.frame_source import FrameSource, announced
from jaxpf.media.images import to_rgb
from jaxpf.media.quiet import quiet_opencv

# At least two letters: a single one is a Windows drive.
_URL = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+://")
#: Timeout of a stream in milliseconds, for opening and for each frame.
_PATIENCE = 10_000
#: Maximum queue of a stream's frames: absorbs uneven pace, needs little memory.
_WAITING = 4
#: Polling interval for Ctrl-C in seconds, because waiting itself may not be interruptible.
_LOOK = 0.2


def live_address(source: str | os.PathLike[str] | int) -> str | int | None:
    """Return a camera's index, or the address of a stream, device or pipe; None for other paths."""
    if isinstance(source, int):
        check_whole("path", source, 0)  # OpenCV crashes at -1
        return source
    text = os.fspath(source)
    if _URL.match(text):
        return text
    path = Path(text)
    if path.is_fifo() or _is_camera(path):
        return text
    # More digits than an index can have: probably a missing file.
    if text.isdecimal() and len(text) < 10 and not path.exists():
        return int(text)
    return None


class LiveSource(FrameSource):
    """Frames of a camera, stream or pipe, which can be read only once.

    A thread reads them, so that Ctrl-C works while no frame arrives.  Frames of a stream or pipe
    are queued; of a camera only the latest frame is kept.

    Attributes:
        num_left_out: number of camera frames dropped because the reader was too slow.
    """

    is_live = True

    def __init__(self, address: str | int, fps: float | None):
        """Open the source and wait for its first frame.

        Args:
            address: see ``live_address``.
            fps: see ``jaxpf.media.open_frames``.
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
        # A daemon thread, so that a silent source cannot keep the program from ending.
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
        """Stop reading; further calls do nothing."""
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
        """Return the next frame, or None after the last one."""
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
        """Read frames into the queue; runs in the thread."""
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
        except Exception as error:  # raised by ``_next``
            self._error = error
        finally:
            with self._news:
                self._ended = True
                self._news.notify_all()

    def _describe(self, capture: Any) -> None:
        rate, count = announced(capture)
        self.fps = self._fps_given or rate or self.fps
        self.frames_expected = None if self.is_camera else count

    def _read_frames(self, capture: Any) -> None:
        while not self._closed:
            asked = time.monotonic()
            with quiet_opencv():
                decoded, frame = capture.read()
            patient = time.monotonic() - asked > 0.9 * _PATIENCE / 1000
            # An incomplete last frame is decoded only after the timeout; then the stream ends.
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
        # Other backends would reopen the pipe and wait for a writer that is already gone.
        return cv2.VideoCapture(address, cv2.CAP_FFMPEG)
    return cv2.VideoCapture(address)


def _is_camera(path: Path) -> bool:
    """Whether a path is a camera device, by Linux naming."""
    return path.is_char_device() and path.resolve().name.startswith("video")


def _names(address: str | int) -> tuple[str, str]:
    """Return the address without a password, and a name for results."""
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
