"""Live frames of cameras, streams and pipes, read once, in a separate thread."""

import collections
import contextlib
import numbers
import os
import re
import threading
import time
from collections.abc import Generator
from pathlib import Path
from urllib.parse import urlsplit

import cv2
import numpy as np

from jaxpf.contract.errors import InputError, check_path
from jaxpf.contract.numbers import check_whole
from jaxpf.media.clock import Clock
from jaxpf.media.decoder import Decoder, NoFilm
from jaxpf.media.frame_source import DEFAULT_FPS, FrameSource
from jaxpf.media.images import to_rgb
from jaxpf.media.quiet import quiet_opencv

# At least two letters: a single one is a Windows drive.
_URL = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+://")
#: Timeout of a stream in seconds, for opening and for each frame.
_PATIENCE = 10.0
#: Maximum queue of a stream's frames: absorbs uneven pace, needs little memory.
_WAITING = 4
#: Polling interval for Ctrl-C in seconds, because waiting itself may not be interruptible.
_LOOK = 0.2

#: Time stamp in seconds, None if it is missing, and picture.
_Frame = tuple[float | None, np.ndarray]


def live_address(source: str | os.PathLike[str] | int) -> str | int | None:
    """Return a camera's index, or the address of a stream, device or pipe; None for other paths."""
    if isinstance(source, numbers.Integral):
        check_whole("path", source, 0)  # OpenCV crashes at -1
        return int(source)
    path = check_path("path", source)
    text = f"{source}"
    if _URL.match(text):
        return text
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
        self._address = address
        self._film: Decoder | None = None
        self.num_left_out = self._counted_from = 0
        self._latest: float | None = None
        self._waiting: collections.deque[_Frame] = collections.deque()
        self._news = threading.Condition()
        self._opened = self._ended = self._closed = self._begun = False
        self._error: Exception | None = None
        # A daemon thread, so that a silent source cannot keep the program from ending.
        threading.Thread(target=self._read_all, daemon=True).start()
        try:
            first = self._next()
            if first is None:
                raise self._no_picture()
        except BaseException:
            self.close()
            raise
        self.height, self.width = first[1].shape[:2]
        self._first: _Frame | None = first

    def close(self) -> None:
        """Stop reading; further calls do nothing."""
        with self._news:
            self._closed = True
            self._news.notify_all()

    def count_from(self, number: int) -> None:
        """Give the latest camera frame this number; numbers and times go on from it."""
        self.num_left_out, self._counted_from = 0, number
        self._clock = Clock(self._clock.rate)
        self._clock.add(self._latest)

    def shown_at(self, number: int) -> float:
        """See ``FrameSource``; frames of a camera are shown when they arrive."""
        return super().shown_at(number - self._counted_from)

    def _frames(self, start: int) -> Generator[np.ndarray]:
        if self._begun:
            raise InputError(
                f"the frames of {self._noun} '{self.path}' can be read only once; open it again"
            )
        self._begun = True
        count, following = 0, self._first
        self._first = None
        try:
            while following is not None:
                self._latest, frame = following
                self._clock.add(self._latest)
                self._check_size(frame, count)
                count += 1
                if count > start:
                    yield frame
                following = self._next()
            self.num_frames = count
            if self._film is not None:
                self._reached_end(self._film, count)
                if self._film.was_silent and not self.truncated:
                    self.note = (
                        f"stream '{self.path}' sent nothing for {_PATIENCE:g} s after frame "
                        f"{count - 1}, and was taken to have ended"
                    )
            if count <= start:
                raise self._past_the_end(start, count)
        finally:
            self.close()
            if self.num_left_out:
                self.note = (
                    f"{self.num_left_out} frames of {self._noun} '{self.path}' came while others "
                    "were tracked, and were left out; fewer particles or --no-overlay may keep up"
                )

    def _next(self) -> _Frame | None:
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
            pictures = self._of_camera() if self.is_camera else self._of_stream()
            with contextlib.closing(pictures):
                for frame in pictures:
                    with self._news:
                        while len(self._waiting) >= _WAITING and not self._closed:
                            self._news.wait()
                        if self._closed:
                            return
                        if self.is_camera and self._waiting:
                            self._waiting.clear()
                            self.num_left_out += 1
                        self._waiting.append(frame)
                        self._news.notify_all()
        except Exception as error:  # raised by ``_next``
            self._error = error
        finally:
            with self._news:
                self._ended = True
                self._news.notify_all()

    def _of_camera(self) -> Generator[_Frame]:
        with quiet_opencv():
            capture = cv2.VideoCapture(self._address)
        try:
            self._opened = capture.isOpened()
            rate = capture.get(cv2.CAP_PROP_FPS)
            self._clock = Clock(rate if 0 < rate <= 1000 else DEFAULT_FPS)
            while self._opened:
                decoded, frame = capture.read()
                if not decoded:
                    return
                yield time.monotonic(), to_rgb(frame, self.path)
        finally:
            capture.release()

    def _of_stream(self) -> Generator[_Frame]:
        is_address = isinstance(self._address, str) and _URL.match(self._address)
        try:
            film = Decoder(str(self._address), _PATIENCE if is_address else None, threads=False)
        except NoFilm:
            return
        with film:
            self._opened, self._clock = True, Clock(film.rate or DEFAULT_FPS)
            for stamp, frame in film.frames():
                picture = film.upright(frame)
                if self._film is None:
                    self._film = film
                    self._describe(film)
                yield stamp, picture

    def _no_picture(self) -> InputError:
        if self.is_camera:
            does = "opens but gives no picture" if self._opened else "does not open"
            index = "; cameras count from 0" if isinstance(self._address, int) else ""
            return InputError(
                f"camera '{self.path}' {does}; check that it is plugged in, that you may use it "
                f"and that no other program does{index}"
            )
        does = "sends no picture that can be decoded" if self._opened else "does not open"
        if isinstance(self._address, str) and _URL.match(self._address):
            check = "check the address, that it is being sent, and that PyAV knows its protocol"
        else:
            check = "check what is written into it: a format that streams, of a known protocol"
        return InputError(f"stream '{self.path}' {does}; {check} and codec")


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
        raise InputError(f"'{address}' is not an address of a stream: {error}") from None
    user, at, host = parts.netloc.rpartition("@")
    user = f"{user.partition(':')[0]}:***" if ":" in user else user
    name = Path(parts.path).stem or host.partition(":")[0] or parts.scheme
    return parts._replace(netloc=f"{user}{at}{host}").geturl(), name
