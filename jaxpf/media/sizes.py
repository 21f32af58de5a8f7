"""Detects videos that change size on the way, which OpenCV silently rescales to the first size."""

import itertools
import os
import sys
from collections.abc import Iterator
from typing import Any

#: Minimum frames between two checks, for videos in which every frame is a keyframe.
_EVERY = 10


class SizeWatch:
    """Watches the coded size of a video frame by frame, alongside the decoder.

    It decodes only frames at which the size may change.  Without PyAV, or if FFmpeg cannot read
    the file, it detects no change.
    """

    def __init__(self, path: str | os.PathLike[str], start: int):
        """Watch a file from frame ``start``."""
        self._all = _coded_sizes(path)
        self._sizes = itertools.islice(self._all, min(start, sys.maxsize), None)
        self._first: tuple[int, int] | None = None

    def change(self) -> str:
        """Return ``64x48 to 96x64`` if the size differs from the first frame's, else ``""``."""
        size = next(self._sizes, None)
        self._first = self._first or size
        if size is None or size == self._first:
            return ""
        return "{}x{} to {}x{}".format(*(self._first or size), *size)

    def close(self) -> None:
        """Release the file."""
        self._all.close()


def _coded_sizes(path: str | os.PathLike[str]) -> Any:
    """Yield width and height of every frame."""
    try:
        import av
    except ModuleNotFoundError:
        return
    try:
        with av.open(os.path.abspath(path)) as container:
            stream = container.streams.video[0]
            yield from _sizes_in(container, stream, av.FFmpegError)
    except (av.FFmpegError, IndexError):
        return


def _sizes_in(container: Any, stream: Any, damage: type[Exception]) -> Iterator[tuple[int, int]]:
    context = stream.codec_context
    context.thread_count = 1  # more threads would delay the size
    looked = -_EVERY
    packets = (packet for packet in container.demux(stream) if packet.size)
    for number, packet in enumerate(packets):
        if packet.is_keyframe and number - looked >= _EVERY:
            looked = number
            try:
                context.decode(packet)
            except damage:
                continue
        yield context.width, context.height
