"""Frames of a camera or a stream, read once and in order by OpenCV."""

import numbers
import os
import re
import time
from collections.abc import Generator
from pathlib import Path
from urllib.parse import urlsplit

import cv2
import numpy as np

from jaxpf.contract.errors import InputError
from jaxpf.media.clock import Clock
from jaxpf.media.frame_source import DEFAULT_FPS, FrameSource
from jaxpf.media.images import to_rgb
from jaxpf.media.quiet import quiet_opencv

# At least two letters: a single one is a Windows drive.
_URL = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+://")
#: Milliseconds to wait for a stream to open, and for each of its frames.
_PATIENCE = 10_000


def live_address(source: str | os.PathLike[str] | int) -> str | int | None:
    """Return a camera's index or a stream's address; None for other paths."""
    if isinstance(source, numbers.Integral):
        return int(source)
    text = f"{source}"
    if _URL.match(text):
        return text
    # More digits than an index can have: probably a missing file.
    if text.isdecimal() and len(text) < 10 and not Path(text).exists():
        return int(text)
    return None


class LiveSource(FrameSource):
    """Frames of a camera or a stream; a second pass goes on where the first one ended.

    Frames of a camera are shown when they arrive, those of a stream by its frame rate.
    """

    is_live = True

    def __init__(self, address: str | int, fps: float | None):
        """Open the source and read its first frame; see ``live_address`` and ``open_frames``."""
        shown, name = _names(address)
        super().__init__(shown, name, fps)
        self._is_camera = isinstance(address, int)
        with quiet_opencv():
            if isinstance(address, int):
                self._capture = cv2.VideoCapture(address)
            else:
                waits = (cv2.CAP_PROP_OPEN_TIMEOUT_MSEC, cv2.CAP_PROP_READ_TIMEOUT_MSEC)
                settings = [number for wait in waits for number in (wait, _PATIENCE)]
                self._capture = cv2.VideoCapture(address, cv2.CAP_FFMPEG, settings)
        rate = self._capture.get(cv2.CAP_PROP_FPS)
        self._clock = Clock(rate if 0 < rate <= 1000 else DEFAULT_FPS)
        self._following = self._read()
        if self._following is None:
            raise self._no_picture()
        self.height, self.width = self._following.shape[:2]

    def _read(self) -> np.ndarray | None:
        decoded, frame = self._capture.read()
        if not decoded:
            return None
        self._clock.add(time.monotonic() if self._is_camera else None)
        return to_rgb(frame, self.path)

    def _frames(self, start: int) -> Generator[np.ndarray]:
        count = 0
        while self._following is not None:
            frame = self._following
            self._check_size(frame, count)
            count += 1
            if count > start:
                yield frame
            self._following = self._read()
        self._capture.release()
        self.num_frames = count
        if count <= start:
            raise self._past_the_end(start, count)

    def _no_picture(self) -> InputError:
        does = "gives no picture" if self._capture.isOpened() else "does not open"
        if self._is_camera:
            return InputError(
                f"camera '{self.path}' {does}; check that it is plugged in, that you may use it "
                "and that no other program does; cameras count from 0"
            )
        return InputError(
            f"stream '{self.path}' {does}; check the address, that it is being sent, and that "
            "OpenCV knows its protocol and codec"
        )


def _names(address: str | int) -> tuple[str, str]:
    """Return the address without a password, and a name for results."""
    if isinstance(address, int):
        return f"{address}", f"camera-{address}"
    try:
        parts = urlsplit(address)
    except ValueError as error:
        raise InputError(f"'{address}' is not an address of a stream: {error}") from None
    user, at, host = parts.netloc.rpartition("@")
    user = f"{user.partition(':')[0]}:***" if ":" in user else user
    name = Path(parts.path).stem or host.partition(":")[0] or parts.scheme
    return parts._replace(netloc=f"{user}{at}{host}").geturl(), name
