"""Decodes films with PyAV."""

import os
from collections.abc import Generator
from fractions import Fraction
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from jaxpf.contract.errors import import_extra

if TYPE_CHECKING:
    import av

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


class NoFilm(Exception):
    """Nothing was found that can be decoded; the message says why, if it is known."""


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
            InputError: PyAV is missing.
            NoFilm: there is nothing to decode.
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
            raise NoFilm from error
        try:
            self._stream = self._film()
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

    def _film(self) -> Any:
        """The stream of frames; the cover of a recording is none."""
        streams = self._container.streams.video
        films = [one for one in streams if not one.disposition & one.disposition.attached_pic]
        if not films:
            raise NoFilm("it holds no moving pictures")
        if films[0].codec_context is None:
            raise NoFilm("its codec is unknown")
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
