"""Videos whose size changes on the way, which OpenCV brings to the first size without a word."""

import itertools
import os
from collections.abc import Iterator
from typing import Any

#: Frames from one look to the next at least, of videos that can be entered anywhere.
_EVERY = 10


class SizeWatch:
    """The size in which a video is coded, frame by frame, beside whoever decodes it.

    Only frames at which a size may change are decoded.  Without PyAV, and where FFmpeg cannot
    read the file, nothing is found.
    """

    def __init__(self, path: str | os.PathLike[str], start: int):
        """Watch a file from frame ``start`` on."""
        self._all = _coded_sizes(path)
        self._sizes = itertools.islice(self._all, start, None)
        self._first: tuple[int, int] | None = None

    def change(self) -> str:
        """``64x48 to 96x64`` where the next frame differs from the first one, else ``""``."""
        size = next(self._sizes, None)
        self._first = self._first or size
        if size is None or size == self._first:
            return ""
        return "{}x{} to {}x{}".format(*(self._first or size), *size)

    def close(self) -> None:
        """Let go of the file."""
        self._all.close()


def _coded_sizes(path: str | os.PathLike[str]) -> Any:
    """Width and height of every frame."""
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
    context.thread_count = 1  # several would put the answer off
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
