"""Opens video files, folders of images, cameras and streams, to be read one frame at a time."""

import errno
import itertools
import numbers
import os
import re
import time
from collections.abc import Generator, Sequence
from pathlib import Path
from urllib.parse import urlsplit

import cv2
import numpy as np

from jaxpf.contract.errors import InputError
from jaxpf.contract.numbers import check_number
from jaxpf.files.writing import report_os_errors
from jaxpf.media.film import DEFAULT_FPS, Clock, FrameSource, VideoFile
from jaxpf.media.images import (
    IMAGE_SUFFIXES,
    check_consecutive,
    check_name,
    check_single,
    levels_of,
    pictures_in,
    quiet_opencv,
    read_image,
    refuse_range,
    to_rgb,
)

# At least two letters: a single one is a Windows drive.
_URL = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+://")
#: Milliseconds to wait for a stream to open, and for each of its frames.
_PATIENCE = 10_000


def open_frames(
    path: str | os.PathLike[str] | int,
    *,
    fps: float | None = None,
    range: Sequence[int] | None = None,
) -> FrameSource:
    """Open a video, a folder of images or a live source for reading.

    A folder's images (png, jpg, jpeg, bmp, tif, tiff, webp) are the frames, in natural order
    (``img2.png`` before ``img10.png``); hidden files are skipped.  The numbers in their names
    must have a constant step.  Grey becomes RGB with three equal channels.  Alpha is
    dropped and the stored colours are kept, even where transparent.  16 bits per channel are
    scaled to 8, full range to full range.  That is 12 bits (or 8) if some images are sampled and no
    value is above 4095 (255); a later image that contradicts this is refused.  If the values of
    the sampled images fill less than a quarter of the range, they become all of 0 to 255, and
    ``note`` says so.

    Frames are turned and mirrored as EXIF and video metadata say.  Those of interlaced video are
    whole, with both fields, as stored; a film to be deinterlaced must be converted.  Frames keep
    their stored size where pixels are not square (``pixel_aspect``): coordinates count pixels.
    Videos need PyAV.

    A live source is a camera by index (from 0, unless a file has that name), or a stream by address
    (``http://``, ``rtsp://``, ...); OpenCV reads it.

    Args:
        path: a video in any format that PyAV decodes, a folder, or a live source.
        fps: frames per second, in place of time stamps; 25 for a folder.
        range: of a folder of images of 16 bits, the values that become 0 and 255.

    Returns:
        A source that has at least one frame.

    Raises:
        InputError: the path does not exist, or no frame can be decoded.
    """
    if path == "":
        raise InputError("no video is named; give its path, or . for the images in this folder")
    if fps is not None:
        check_number("fps", fps, above=0)
    address = _live_address(path)
    if address is not None:
        refuse_range(range, address)
        return _LiveSource(address, fps)
    path = Path(f"{path}")
    check_name(path)
    with report_os_errors("read", f"{path}"):
        if path.is_dir():
            return _ImageFolder(path, fps, range)
        try:
            size = path.stat().st_size
        except OSError as error:
            if error.errno not in (errno.ENOENT, errno.ENOTDIR):
                raise
            raise InputError(
                f"there is no video or folder at '{path}'; check the path (current folder: "
                f"'{Path.cwd()}')"
            ) from None
    if not size:
        raise InputError(f"video '{path}' is empty (0 bytes); copy or record it again")
    if path.suffix.lower() in IMAGE_SUFFIXES:
        check_single(path)
        raise InputError(
            f"'{path}' is a single image; give the folder that holds the images, or a video"
        )
    refuse_range(range, path)
    return VideoFile(path, fps)


def open_pictures(files: Sequence[Path]) -> FrameSource:
    """Open pictures of one folder as frames, in this order; see ``open_frames``.

    Raises:
        InputError: a picture is missing, or the first one cannot be decoded.
    """
    for file in files:
        if not file.is_file():
            raise InputError(f"there is no picture '{file}'; add it, or correct the sequence")
    return _ImageFolder(files[0].parent, None, None, files)


class _ImageFolder(FrameSource):
    """A folder whose images, or some of them in the given order, are the frames."""

    def __init__(
        self,
        path: Path,
        fps: float | None,
        range: Sequence[int] | None,
        files: Sequence[Path] = (),
    ):
        super().__init__(path, path.resolve().name, fps)
        self._files = list(files or pictures_in(path))
        names = self.pictures = [file.name for file in self._files]
        if not names:
            suffixes = ", ".join(suffix.lstrip(".") for suffix in IMAGE_SUFFIXES)
            raise InputError(
                f"folder '{path}' holds no images ({suffixes}); give one that does, or a video"
            )
        notes = [check_consecutive(path, names)]
        for entry in self._files:
            check_name(entry)
            check_single(entry)
        self.frames_expected = self.num_frames = len(names)
        self._levels = levels_of(self._files, range)
        self.height, self.width = read_image(self._files[0], self._levels).shape[:2]
        notes += [self._levels.note]
        if len(names) == 1:
            notes += [f"folder '{path}' holds one image only, '{names[0]}'"]
        self.note = "; ".join(filter(None, notes)) or None

    def _pictures(self, start: int) -> Generator[np.ndarray | None]:
        for number, file in enumerate(self._files):
            yield read_image(file, self._levels) if number >= start else None


def _live_address(source: str | os.PathLike[str] | int) -> str | int | None:
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


class _LiveSource(FrameSource):
    """Frames of a camera or a stream; a second pass goes on where the first one ended.

    Frames of a camera are shown when they arrive, those of a stream by its frame rate.
    """

    is_live = True

    def __init__(self, address: str | int, fps: float | None):
        """Open the source and read its first frame; see ``_live_address`` and ``open_frames``."""
        super().__init__(*_names(address), fps)
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

    def _pictures(self, start: int) -> Generator[np.ndarray | None]:
        for number in itertools.count():
            if self._following is None:
                break
            yield self._following if number >= start else None
            self._following = self._read()
        self._capture.release()

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
