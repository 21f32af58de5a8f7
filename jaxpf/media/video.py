"""Reads video files, folders of images and live sources, one frame at a time.

Frames are uint8 RGB arrays [H, W, 3].  See :mod:`jaxpf.media.live` for live sources.
"""

import math
import os
from collections.abc import Generator, Sequence
from numbers import Real
from pathlib import Path

import cv2
import numpy as np

from jaxpf.contract.errors import InputError, check_type
from jaxpf.media.frame_source import DEFAULT_FPS, FrameSource, announced
from jaxpf.media.images import (
    IMAGE_SUFFIXES,
    check_consecutive,
    check_name,
    check_single,
    frames_inside,
    full_range,
    pictures_in,
    read_image,
    to_rgb,
)
from jaxpf.media.live import LiveSource, live_address
from jaxpf.media.quiet import quiet_opencv
from jaxpf.media.sizes import SizeWatch
from jaxpf.media.video_writer import VideoWriter

__all__ = ["DEFAULT_FPS", "FrameSource", "VideoWriter", "open_frames"]

# Signatures of common containers; used only to distinguish "damaged" from "not a video".
_CONTAINERS = ((4, b"ftyp", "MP4"), (8, b"AVI ", "AVI"), (0, b"\x1a\x45\xdf\xa3", "WebM or MKV"))


def open_frames(path: str | os.PathLike[str] | int, fps: float | None = None) -> FrameSource:
    """Open a video, a folder of images or a live source for reading.

    A folder's images (png, jpg, jpeg, bmp, tif, tiff, webp) are the frames, in natural order
    (``img2.png`` before ``img10.png``); hidden files are skipped.  The numbers in their names
    must have a constant step.  Grey becomes RGB with three equal channels.  Alpha is
    dropped and the stored colours are kept, even where transparent.  16 bits per channel are
    scaled to 8, full range to full range; if no value of the first image is above 4095, the full
    range is 12 bits.  Rotation marks of cameras (EXIF, video metadata) are applied.

    Live sources are a camera by index (from 0, unless a file has that name) or device, a stream
    by address (``http://``, ``rtsp://``, ...) and a pipe, if OpenCV can open them.

    Args:
        path: a video in any format that OpenCV decodes, a folder, or a live source.
        fps: frames per second, overriding the container's value.

    Returns:
        A source that has at least one frame.

    Raises:
        InputError: the path does not exist, or no frame can be decoded.
    """
    if path == "":
        raise InputError("no video is named; give its path, or . for the images in this folder")
    address = live_address(path)
    path = Path(f"{path}")
    if fps is not None:
        check_type("fps", fps, Real)
    if fps is not None and not (math.isfinite(fps) and fps > 0):
        raise InputError(f"fps {fps} for '{path}' is not a positive number; give one such as 25")
    if address is not None:
        return LiveSource(address, fps)
    check_name(path)
    if path.is_dir():
        return _ImageFolder(path, fps)
    if not path.exists():
        raise InputError(
            f"there is no video or folder at '{path}'; check the path (current folder: "
            f"'{Path.cwd()}')"
        )
    try:
        beginning = _read_beginning(path)
    except OSError as error:
        raise InputError(
            f"cannot read '{path}': {(error.strerror or str(error)).lower()}; check its permissions"
        ) from error
    if not beginning:
        raise InputError(f"video '{path}' is empty (0 bytes); copy or record it again")
    if path.suffix.lower() in IMAGE_SUFFIXES:
        check_single(path)
        raise InputError(
            f"'{path}' is a single image; give the folder that holds the images, or a video"
        )
    if _is_text(beginning):
        # FFmpeg would render the text as pictures.
        raise InputError(f"'{path}' is a text file; give a video or a folder of images")
    return _VideoFile(path, fps, beginning)


def open_pictures(files: Sequence[Path], fps: float | None = None) -> FrameSource:
    """Open pictures of one folder as frames, in this order; see ``open_frames``.

    Raises:
        InputError: a picture is missing, or the first one cannot be decoded.
    """
    for file in files:
        if not file.is_file():
            raise InputError(f"there is no picture '{file}'; add it, or correct the sequence")
    return _ImageFolder(files[0].parent, fps, files)


class _VideoFile(FrameSource):
    """A file decoded by OpenCV."""

    def __init__(self, path: Path, fps: float | None, beginning: bytes):
        super().__init__(path, path.stem, fps)
        capture, frame, rate = self._open(), None, None
        try:
            with quiet_opencv():
                if capture.isOpened():
                    rate, self.frames_expected = announced(capture)
                    frame = capture.read()[1]
        finally:
            capture.release()
        if frame is None:
            raise _undecodable(path, beginning)
        # From a decoded frame, because rotation can swap the header's width and height.
        self.height, self.width = frame.shape[:2]
        self._announced_fps = rate or DEFAULT_FPS
        self.fps = fps or self._announced_fps
        self._has_timestamps = fps is None
        self._seconds: list[float] = []  # timestamps of the frames read in the latest pass

    def _open(self) -> cv2.VideoCapture:
        with quiet_opencv():
            # An absolute path, because FFmpeg reads text before a colon as a protocol.
            return cv2.VideoCapture(str(Path(self.path).absolute()))

    def shown_at(self, number: int) -> float:
        """See ``FrameSource``; a given ``fps`` replaces the timestamps."""
        if not self._has_timestamps or not 0 < number < len(self._seconds):
            return super().shown_at(number)
        shown = self._seconds[number] - self._seconds[0]
        is_later = math.isfinite(shown) and self._seconds[number] > self._seconds[number - 1]
        return shown if is_later else super().shown_at(number)

    def _frames(self, start: int) -> Generator[np.ndarray]:
        capture, watch = self._open(), SizeWatch(self.path, start)
        self._seconds = seconds = []
        try:
            for skipped in range(start):
                with quiet_opencv():
                    decoded = capture.grab()
                seconds.append(capture.get(cv2.CAP_PROP_POS_MSEC) / 1000)
                if not decoded:
                    self._reached_end(skipped, last_time=0.0)
                    raise self._past_the_end(start, skipped)
            count, last_time = start, 0.0
            while True:
                with quiet_opencv():
                    decoded, frame = capture.read()
                if not decoded:
                    break
                if change := watch.change():
                    raise InputError(
                        f"video '{self.path}' changes its size at frame {count}, from {change}; "
                        "convert it to one size"
                    )
                last_time = capture.get(cv2.CAP_PROP_POS_MSEC) / 1000
                seconds.append(last_time)
                count += 1
                yield to_rgb(frame, self.path)
            if count == start:
                self._reached_end(count, last_time)
                raise self._past_the_end(start, count)
            self._reached_end(count, last_time)
        finally:
            watch.close()
            capture.release()

    def _reached_end(self, count: int, last_time: float) -> None:
        """Compare the number of decoded frames, ``count``, with the announced number."""
        self.num_frames = count
        expected = self.frames_expected
        if expected is None or count >= expected:
            return
        tolerance = max(2, expected // 100)
        # If the announced count is only duration times rate, a variable frame rate makes it wrong,
        # but the last timestamp still lies at the announced end.
        end = (last_time * self._announced_fps) + 1
        what = f"'{self.path}' announces {expected} frames, and {count} can be decoded"
        if expected - count <= tolerance:
            self.note = f"{what}; such a small difference is usually rounding by the container"
        elif end >= expected - tolerance:
            self.note = (
                f"{what}, up to its announced end: the frame rate varies, or frames within it "
                "are damaged"
            )
        else:
            self.truncated = True
            self.note = (
                f"{what}: it is cut off or damaged after frame {count - 1}; copy or convert it "
                "again if the rest matters"
            )


class _ImageFolder(FrameSource):
    """A folder whose images, or some of them in the given order, are the frames."""

    def __init__(self, path: Path, fps: float | None, files: Sequence[Path] | None = None):
        super().__init__(path, path.resolve().name, fps)
        given, files = files, list(files or pictures_in(path))
        self._files = files
        # A single picture beside a video or a folder of frames is a preview, not the sequence.
        meant = frames_inside(path) if len(files) < 2 and not given else None
        content = f"one image only, '{files[0].name}'" if files else "no images"
        if meant is not None:
            raise InputError(f"folder '{path}' holds {content}; did you mean '{meant}'?")
        if not files:
            suffixes = ", ".join(suffix.lstrip(".") for suffix in IMAGE_SUFFIXES)
            raise InputError(
                f"folder '{path}' holds no images ({suffixes}); give a folder that does"
            )
        self.note = check_consecutive(path, [entry.name for entry in self._files])
        for entry in self._files:
            check_name(entry)
            check_single(entry)
        self.frames_expected = self.num_frames = len(self._files)
        self.height, self.width = read_image(self._files[0]).shape[:2]
        self._most = full_range(self._files[0])
        if self._most == 4095:
            self.note = f"no value in '{self._files[0]}' is above 4095, so its 16 bits count as 12"
        if len(files) == 1:
            self.note = f"folder '{path}' holds {content}"

    def _frames(self, start: int) -> Generator[np.ndarray]:
        for file in self._files[start:]:
            frame = read_image(file, self._most)
            if frame.shape[:2] != (self.height, self.width):
                raise InputError(
                    f"folder '{self.path}' mixes image sizes: '{self._files[0].name}' is "
                    f"{self.width}x{self.height} but '{file.name}' is "
                    f"{frame.shape[1]}x{frame.shape[0]}; keep only frames of one size"
                )
            yield frame


def _read_beginning(path: Path) -> bytes:
    with open(path, "rb") as file:
        return file.read(4096)


def _is_text(beginning: bytes) -> bool:
    if beginning.startswith(b"YUV4MPEG2"):
        return False
    if any(byte < 32 and byte not in b"\b\t\n\f\r\x1b" for byte in beginning):
        return False
    try:
        beginning.decode("utf-8")
    except UnicodeDecodeError as error:
        # The bytes read may end within a character.
        return error.start >= len(beginning) - 3
    return True


def _undecodable(path: Path, beginning: bytes) -> InputError:
    for offset, magic, container in _CONTAINERS:
        if beginning[offset : offset + len(magic)] == magic:
            return InputError(
                f"video '{path}' cannot be decoded: it begins as {container} but is cut off, "
                "damaged or in a codec that OpenCV lacks; copy it again or convert it"
            )
    return InputError(
        f"'{path}' is not a video that OpenCV can read; give a video (mp4, avi, webm, mkv) or a "
        "folder of images"
    )
