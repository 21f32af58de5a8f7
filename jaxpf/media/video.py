"""Reads video files, folders of images and live sources, one frame at a time."""

import errno
import itertools
import os
import time
from collections.abc import Generator, Sequence
from pathlib import Path

import numpy as np

from jaxpf.contract.errors import Argument, InputError
from jaxpf.contract.numbers import check_number
from jaxpf.files.writing import report_os_errors
from jaxpf.media.clock import Clock
from jaxpf.media.decoder import Decoder, NoFilm
from jaxpf.media.frame_source import DEFAULT_FPS, FrameSource
from jaxpf.media.images import (
    IMAGE_SUFFIXES,
    check_consecutive,
    check_name,
    check_single,
    frames_inside,
    levels_of,
    no_range,
    pictures_in,
    read_image,
)
from jaxpf.media.live import LiveSource, live_address

# Signatures of common containers; used only to distinguish "damaged" from "not a video".
_CONTAINERS = ((4, b"ftyp", "MP4"), (8, b"AVI ", "AVI"), (0, b"\x1a\x45\xdf\xa3", "WebM or MKV"))
#: Number of frames that are decoded on opening.
_SHOWN = 16
#: Seconds of decoding after which an estimate of the number of frames will do.
_PATIENCE = 5.0


def open_frames(
    path: str | os.PathLike[str] | int,
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
    if range is not None and not 0 <= range[0] < range[1] <= 65535:
        raise InputError(
            Argument("range", range, typed=",".join(map(str, range))),
            " must be two whole numbers from 0 to 65535, black before white.",
        )
    address = live_address(path)
    if address is not None:
        if range is not None:
            raise no_range(address, range)
        return LiveSource(address, fps)
    path = Path(f"{path}")
    check_name(path)
    with report_os_errors("read", f"{path}"):
        if path.is_dir():
            return _ImageFolder(path, fps, range=range)
        try:
            with open(path, "rb") as file:
                beginning = file.read(16)
        except OSError as error:
            if error.errno not in (errno.ENOENT, errno.ENOTDIR):
                raise
            raise InputError(
                f"there is no video or folder at '{path}'; check the path (current folder: "
                f"'{Path.cwd()}')"
            ) from None
    if not beginning:
        raise InputError(f"video '{path}' is empty (0 bytes); copy or record it again")
    if path.suffix.lower() in IMAGE_SUFFIXES:
        check_single(path)
        raise InputError(
            f"'{path}' is a single image; give the folder that holds the images, or a video"
        )
    if range is not None:
        raise no_range(path, range)
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
    """A file decoded by PyAV."""

    def __init__(self, path: Path, fps: float | None, beginning: bytes):
        super().__init__(path, path.stem, fps)
        picture = None
        try:
            with Decoder(path) as film:
                self._clock = Clock(film.rate or DEFAULT_FPS)
                # Some headers give a clock rate as frame rate, so the first frames show it.
                for stamp, frame in itertools.islice(film.frames(), _SHOWN):
                    self._clock.add(stamp)
                    if picture is None:
                        picture = film.upright(frame)
                        self._describe(film)
                        self._is_counted = film.is_counted
        except NoFilm as error:
            raise _undecodable(path, beginning, str(error)) from error
        if picture is None:
            raise _undecodable(path, beginning, "")
        # From a decoded frame, because rotation can swap the header's width and height.
        self.height, self.width = picture.shape[:2]

    def count_frames(self) -> int:
        """See ``FrameSource``."""
        if self.num_frames is None and not self._is_counted:
            end, count = time.monotonic() + _PATIENCE, 0
            with self._decoder() as film:
                for count, _ in enumerate(film.frames(), 1):
                    if self.frames_expected and time.monotonic() > end:
                        return max(self.frames_expected, count)
            self.num_frames = count
        return super().count_frames()

    def _decoder(self) -> Decoder:
        """Open the film again, for a pass over its frames."""
        try:
            return Decoder(self.path)
        except NoFilm:
            raise InputError(
                f"video '{self.path}' was removed or replaced after it was opened; open it again"
            ) from None

    def _frames(self, start: int) -> Generator[np.ndarray]:
        clock = self._clock = Clock(self._clock.rate)
        count = 0
        with self._decoder() as film:
            for stamp, frame in film.frames():
                clock.add(stamp)
                if count >= start:
                    picture = film.upright(frame)
                    self._check_size(picture, count)
                    yield picture
                count += 1
            self._reached_end(film, count)
        if count <= start:
            raise self._past_the_end(start, count)

    def _describe(self, film: Decoder) -> None:
        """Take what a ``Decoder`` knows once its first frame is upright."""
        self.frames_expected = film.frames_expected
        self.pixel_aspect = film.pixel_aspect
        if film.pixel_aspect != 1:
            self.note = (
                f"pixels of '{self.path}' are {float(film.pixel_aspect):.3g} times as wide as "
                "high; coordinates count pixels"
            )

    def _reached_end(self, film: Decoder, count: int) -> None:
        """Judge a ``Decoder`` that has yielded all ``count`` frames."""
        self.num_frames = count
        self.truncated = film.is_cut(self._clock.rate)
        if self.truncated:
            expected = film.frames_expected
            self.note = (
                f"'{self.path}' announces {expected} frames, and {count} can be decoded: it is cut "
                f"off or damaged after frame {count - 1}; copy or convert it again if the rest "
                "matters"
            )
        elif film.damaged:
            self.note = (
                f"'{self.path}' is damaged: {film.damaged} frame(s) are missing or decoded only in "
                "part; copy it again"
            )


class _ImageFolder(FrameSource):
    """A folder whose images, or some of them in the given order, are the frames."""

    def __init__(
        self,
        path: Path,
        fps: float | None,
        files: Sequence[Path] | None = None,
        range: Sequence[int] | None = None,
    ):
        super().__init__(path, path.resolve().name, fps)
        given, files = files, list(files or pictures_in(path))
        self._files, self.pictures = files, [file.name for file in files]
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
        notes = [check_consecutive(path, self.pictures)]
        for entry in self._files:
            check_name(entry)
            check_single(entry)
        self.frames_expected = self.num_frames = len(self._files)
        self._levels = levels_of(self._files, range)
        self.height, self.width = read_image(self._files[0], self._levels).shape[:2]
        notes += [self._levels.note]
        if len(files) == 1:
            notes += [f"folder '{path}' holds {content}"]
        self.note = "; ".join(filter(None, notes)) or None

    def _frames(self, start: int) -> Generator[np.ndarray]:
        for file in self._files[start:]:
            frame = read_image(file, self._levels)
            if frame.shape[:2] != (self.height, self.width):
                raise InputError(
                    f"folder '{self.path}' mixes image sizes: '{self._files[0].name}' is "
                    f"{self.width}x{self.height} but '{file.name}' is "
                    f"{frame.shape[1]}x{frame.shape[0]}; keep only frames of one size"
                )
            yield frame


def _undecodable(path: Path, beginning: bytes, why: str) -> InputError:
    known = [kind for at, magic, kind in _CONTAINERS if beginning[at:].startswith(magic)]
    if why or known:
        why = why or f"it begins as {known[0]} but is cut off or damaged"
        return InputError(f"video '{path}' cannot be decoded: {why}; copy it again or convert it")
    return InputError(
        f"'{path}' is not a video; give a video (mp4, avi, webm, mkv) or a folder of images"
    )
