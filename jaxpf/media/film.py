"""Films: the interface of every source of frames, and video files, decoded by PyAV."""

import itertools
import os
import time
from array import array
from collections.abc import Generator
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from jaxpf.contract.errors import InputError, import_extra

if TYPE_CHECKING:
    import av

#: Number of frames that are decoded on opening.
_SHOWN = 16
#: Seconds of decoding after which an estimate of the number of frames will do.
_PATIENCE = 5.0
#: Formats that a file may have.  Others name further files or addresses (playlists), or show text.
_FORMATS = (
    "apng,asf,av1,avi,cavsvideo,cine,dhav,dirac,dnxhd,dv,evc,flic,flv,gif,gxf,h261,h263,h264,hevc,"
    "ivf,lxf,m4v,matroska,mjpeg,mjpeg_2000,mov,mp4,mpeg,mpegts,mpegvideo,mxf,nsv,nut,nuv,obu,ogg,"
    "rm,ser,smjpeg,swf,vc1,vc1test,vvc,webm,webp,wtv,yuv4mpegpipe"
)
#: Formats whose header announces the duration.
_ANNOUNCING = {"asf", "avi", "flv", "matroska", "mxf"}
#: A film that ends earlier than announced by more than this many frames and this share is cut off.
#: The last frame often has no duration.
_TOLERANCE = 1.5, 0.01
#: Sizes of a transport stream's packets, bytes, without and with error correction, and how
#: each begins.
_TS_PACKETS, _TS_SYNC = (188, 204), b"\x47"
#: A time stamp that is earlier than the previous one by more than this many frame periods begins
#: another count, as where films are joined; by less, the stamps are out of order.
_RESTART = 2
#: A step this many times the median is a pause, or a frame is missing.
_PAUSE = 1.75
#: Number of latest steps whose median is the frame period.
_LATEST = 100
#: Frames per second if the source does not specify it.
DEFAULT_FPS = 25.0


class FrameSource:
    """Frames of one video, read on demand; repeatedly, unless the source is live.

    Iterating decodes from the beginning and keeps no frame, so memory does not grow with the
    length.

    Attributes:
        path: the file or folder; for a live source its address as text, without a password.
        name: the file name without suffix, or the folder's name; results use it.
        is_live: whether frames come only once and their number is unknown beforehand.
        width: of every frame, pixels.
        height: of every frame, pixels.
        pixel_aspect: width of a pixel over its height.  Coordinates count pixels, whatever their
            shape.
        frames_expected: number of frames according to the container, often inexact; None if it
            gives none.
        num_frames: exact number of frames; None until known.  Folders know it at once, videos
            after a pass to the end.
        pictures: the file names of a folder's frames; None for other sources.
        truncated: True once a pass has shown that the video is cut off: every decodable frame was
            yielded, and ``note`` describes the missing rest.
        note: one sentence to show the user, or None.
    """

    is_live = False

    def __init__(self, path: Path | str, name: str, fps: float | None):
        self.path, self.name = path, name
        self.width = self.height = 0
        self.pixel_aspect = Fraction(1)
        self._given_fps = fps
        self._clock = Clock(DEFAULT_FPS)
        self.frames_expected: int | None = None
        self.num_frames: int | None = None
        self.pictures: list[str] | None = None
        self.truncated = False
        self.note: str | None = None

    @property
    def fps(self) -> float:
        """Frames per second: as given, else by the time stamps of the latest pass, or 25.

        It is a mean without pauses; ``shown_at`` has the time of each frame.
        """
        return self._given_fps or self._clock.rate

    def frames(self, start: int = 0) -> Generator[np.ndarray]:
        """Yield the frames from number ``start`` (counting from 0) to the end.

        Frames before ``start`` are decoded and dropped, because seeking by timestamps lands on the
        wrong frame in many videos.

        Yields:
            uint8 RGB [H, W, 3]; each is a fresh array.

        Raises:
            InputError: ``start`` is past the end, or a frame is unusable.
        """
        if self.num_frames is not None and start >= self.num_frames:
            raise self._past_the_end(start, self.num_frames)
        return self._frames(start)

    def _frames(self, start: int) -> Generator[np.ndarray]:
        count = 0
        for count, picture in enumerate(self._pictures(start), 1):
            if picture is not None:
                self._check_size(picture, count - 1)
                yield picture
        self.num_frames = count
        if count <= start:
            raise self._past_the_end(start, count)

    def _pictures(self, start: int) -> Generator[np.ndarray | None]:
        """Yield every frame, as None if its number is below ``start``."""
        raise NotImplementedError

    def _past_the_end(self, start: int, count: int) -> InputError:
        return InputError(
            f"frame {start} is past the end of '{self.path}', which has {count} frame(s); "
            f"choose one from 0 to {count - 1}"
        )

    def _check_size(self, picture: np.ndarray, number: int) -> None:
        height, width = picture.shape[:2]
        if (height, width) != (self.height, self.width):
            place = f"'{self.pictures[number]}'" if self.pictures else f"frame {number}"
            raise InputError(
                f"'{self.path}' changes its size at {place}, from {self.width}x{self.height} to "
                f"{width}x{height}; convert it to one size"
            )

    def count_frames(self) -> int:
        """The number of frames, found by decoding the video once if its header has no count.

        If that takes long and the header gives the duration, the number is an estimate.
        """
        return self.num_frames or self.frames_expected or 1

    def shown_at(self, number: int) -> float:
        """Seconds after the first frame at which a frame that has been read is shown.

        By the time stamps of a video, whose frame rate may vary; number / fps for a folder, or if
        ``fps`` was given.
        """
        if self._given_fps or number >= len(self._clock):
            return number / self.fps
        return self._clock[number]

    def __iter__(self) -> Generator[np.ndarray]:
        return self.frames()


class VideoFile(FrameSource):
    """A file decoded by PyAV."""

    def __init__(self, path: Path, fps: float | None):
        super().__init__(path, path.stem, fps)
        with Decoder(path) as film:
            self._clock = Clock(film.rate or DEFAULT_FPS)
            # Some headers give a clock rate as frame rate, so the first frames show it.
            for stamp, frame in itertools.islice(film.frames(), _SHOWN):
                self._clock.add(stamp)
                if not self.height:
                    # From a decoded frame, because rotation can swap the header's width and height.
                    self.height, self.width = film.upright(frame).shape[:2]
        if not self.height:
            raise _undecodable(path, "no frame was found")
        self.frames_expected, self._is_counted = film.frames_expected, film.is_counted
        self.pixel_aspect = film.pixel_aspect
        if film.pixel_aspect != 1:
            self.note = (
                f"pixels of '{path}' are {float(film.pixel_aspect):.3g} times as wide as high; "
                "coordinates count pixels"
            )

    def count_frames(self) -> int:
        """See ``FrameSource``."""
        if self.num_frames is None and not self._is_counted:
            end, count = time.monotonic() + _PATIENCE, 0
            with Decoder(self.path) as film:
                for count, _ in enumerate(film.frames(), 1):
                    if self.frames_expected and time.monotonic() > end:
                        return max(self.frames_expected, count)
            self.num_frames = count
        return super().count_frames()

    def _pictures(self, start: int) -> Generator[np.ndarray | None]:
        clock = self._clock = Clock(self._clock.rate)
        with Decoder(self.path) as film:
            for number, (stamp, frame) in enumerate(film.frames()):
                clock.add(stamp)
                yield film.upright(frame) if number >= start else None
            self._judge(film, len(clock))

    def _judge(self, film: "Decoder", count: int) -> None:
        """Say whether a film whose ``count`` frames have all been decoded is whole."""
        self.truncated = film.is_cut(self._clock.rate)
        if self.truncated:
            self.note = (
                f"'{self.path}' announces {film.frames_expected} frames, and {count} can be "
                f"decoded: it is cut off or damaged after frame {count - 1}; copy or convert it "
                "again if the rest matters"
            )
        elif film.damaged:
            self.note = (
                f"'{self.path}' is damaged: {film.damaged} frame(s) are missing or decoded only in "
                "part; copy it again"
            )


def _undecodable(path: object, why: str) -> InputError:
    return InputError(
        f"'{path}' cannot be decoded ({why}): it is cut off or damaged, or not a video (mp4, avi, "
        "webm, mkv) or a folder of images; copy it again or convert it"
    )


class Decoder:
    """One pass over the frames of a film; use it as a context manager.

    Attributes:
        rate: frames per second according to the header; None if unlikely.
        frames_expected: number of frames according to the header; None if it gives none.
        is_counted: whether the header counts frames, rather than giving the duration.
        pixel_aspect: width over height of the pixels of upright frames.
        damaged: number of frames that could not be decoded, or only in part.
    """

    def __init__(self, file: str | os.PathLike[str]):
        """Open a film.

        Raises:
            InputError: PyAV is missing, or there is nothing to decode.
        """
        av = import_extra("av", f"reading the video '{file}' needs PyAV")
        from av.sidedata.sidedata import Type
        from av.video.reformatter import VideoReformatter

        self._av, self._matrix, self._to_rgb = av, Type.DISPLAYMATRIX, VideoReformatter()
        self.damaged, self._end, self._num_packets = 0, 0.0, 0
        # Titles of old films are not UTF-8.  From PyAV 19 on that is no error.
        is_older = int(av.__version__.partition(".")[0]) < 19
        titles = {"metadata_errors": "replace"} if is_older else {}
        try:
            # An absolute path, because FFmpeg reads text before a colon as a protocol.
            options = {"format_whitelist": _FORMATS, "protocol_whitelist": "file"}
            # Else a clock that is set back counts as one that wraps, after 26 hours.
            options["correct_ts_overflow"] = "0"
            self._container: Any = av.open(os.path.abspath(file), options=options, **titles)
        except (av.FFmpegError, ValueError) as error:
            raise _undecodable(file, f"{getattr(error, 'strerror', error)}".lower()) from error
        try:
            self._stream = self._film(file)
            # With H.264 decoded in parallel, FFmpeg marks damaged frames at random, too late.
            if self._stream.codec_context.name != "h264":
                self._stream.thread_type = "AUTO"
        except BaseException:
            self._container.close()
            raise
        rate = self._stream.average_rate or self._stream.guessed_rate
        # Above 1000 it is the container's clock rate, not a frame rate.
        self.rate = float(rate) if rate and 0 < rate < 1000 else None
        self._seconds = (self._container.duration or 0) / av.time_base
        seconds = float((self._stream.duration or 0) * self._stream.time_base) or self._seconds
        # Of a film in fragments, the header counts the frames of the first.
        count = max(self._stream.frames, round(seconds * (self.rate or 0)))
        self.frames_expected: int | None = count or None
        self.is_counted = 0 < self._stream.frames == count
        self._formats = self._container.format.name.split(",")
        self._is_avi = "avi" in self._formats
        if self._is_avi and self.rate:
            # The duration of an AVI without its index would be that of the frames found.
            self._seconds = self._stream.frames / self.rate
        self.pixel_aspect = Fraction(self._stream.sample_aspect_ratio or 1)

    def _film(self, file: object) -> Any:
        """The stream of frames; the cover of a recording is none."""
        streams = self._container.streams.video
        films = [one for one in streams if not one.disposition & one.disposition.attached_pic]
        if not films:
            raise _undecodable(file, "it holds no moving pictures")
        if films[0].codec_context is None:
            raise _undecodable(file, "its codec is unknown")
        return films[0]

    def frames(self) -> "Generator[tuple[float | None, av.VideoFrame]]":
        """Yield time stamps in seconds, None where missing, and frames for ``upright``."""
        streams = self._container.streams
        try:
            for packet in self._container.demux([*streams.video, *streams.audio]):
                if packet.stream is self._stream:
                    yield from self._decoded(packet)
                else:
                    self._note_end(packet)
            # The last frame of a transport stream need not show that its end is missing.
            self.damaged += "mpegts" in self._formats and not self._ends_in_a_packet()
        except self._av.FFmpegError:
            self.damaged += 1

    def _decoded(self, packet: Any) -> "Generator[tuple[float | None, av.VideoFrame]]":
        self._num_packets += packet.dts is not None  # as in the packet that ends all
        # Not every codec marks the frame of a packet that is cut off.  In transport streams, whole
        # packets are marked where two films are joined.
        self.damaged += packet.is_corrupt and "mpegts" not in self._formats
        try:
            frames = packet.decode()
        except self._av.FFmpegError:
            self.damaged += 1
            return
        for frame in frames:
            self.damaged += frame.is_corrupt
            self._note_end(frame)
            # AVI stores no presentation times; those that FFmpeg guesses are out of order.
            at = frame.dts if self._is_avi or frame.pts is None else frame.pts
            yield None if at is None else float(at * frame.time_base), frame

    def _ends_in_a_packet(self) -> bool:
        path = self._container.name
        with open(path, "rb") as file:
            file.seek(max(0, os.path.getsize(path) - max(_TS_PACKETS)))
            end = file.read()
        return any(end[-size:].startswith(_TS_SYNC) for size in _TS_PACKETS)

    def _note_end(self, part: Any) -> None:
        at = part.dts if part.pts is None else part.pts
        if at is not None and part.time_base:
            self._end = max(self._end, float((at + (part.duration or 0)) * part.time_base))

    def upright(self, frame: Any) -> np.ndarray:
        """Convert a frame to uint8 RGB ``[H, W, 3]``, turned and mirrored as it is to be shown."""
        picture = self._to_rgb.reformat(frame, format="rgb24").to_ndarray()
        turned = frame.side_data.get(self._matrix)
        if turned is None:
            return picture
        a, b, _, c, d = np.frombuffer(turned, np.int32)[:5].tolist()
        if abs(b) > abs(a):
            picture, a, d = picture.transpose(1, 0, 2), c, b
            self.pixel_aspect = 1 / Fraction(self._stream.sample_aspect_ratio or 1)
        return np.ascontiguousarray(picture[:: -1 if d < 0 else 1, :: -1 if a < 0 else 1])

    def is_cut(self, rate: float) -> bool:
        """Whether, after a pass at ``rate`` frames per second, all streams ended too early."""
        if "mov" in self._formats:
            # Its index lists every frame; that of a film in fragments is complete now.
            self.frames_expected = len(self._stream.index_entries)
            return self._num_packets < self.frames_expected
        if not _ANNOUNCING.intersection(self._formats):
            return False
        frames, share = _TOLERANCE
        return self._end < self._seconds - max(frames / rate, share * self._seconds)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self._container.close()


class Clock:
    """Times of frames in seconds after the first; each is later than the one before.

    A missing, repeated or earlier time stamp counts as one frame period; pauses are kept.
    """

    def __init__(self, rate: float):
        """Begin; ``rate`` in frames per second holds until time stamps show another one."""
        self._rate = rate
        self._times = array("d")  # 8 bytes a frame
        self._stamp = self._offset = 0.0

    def add(self, stamp: float | None) -> None:
        """Add the next frame and its time stamp in seconds, None if it has none."""
        if not self._times:
            self._stamp = stamp or 0.0
            self._offset = -self._stamp
            self._times.append(0.0)
            return
        latest, time = self._times[-1], None if stamp is None else stamp + self._offset
        if time is None or time <= latest:
            time = latest + self._period()
        if stamp is not None:
            if self._stamp - stamp > 0 and self._stamp - stamp > _RESTART * self._period():
                self._offset = time - stamp
            self._stamp = stamp
        self._times.append(time)

    def __getitem__(self, number: int) -> float:
        return self._times[number]

    def __len__(self) -> int:
        return len(self._times)

    @property
    def rate(self) -> float:
        """Frames per second: one over the mean of the steps, without pauses."""
        steps = np.diff(self._times)
        if not len(steps):
            return self._rate
        return float(1 / steps[steps < _PAUSE * np.median(steps)].mean())

    def _period(self) -> float:
        steps = np.diff(self._times[-_LATEST:])
        return float(np.median(steps)) if len(steps) else 1 / self._rate
