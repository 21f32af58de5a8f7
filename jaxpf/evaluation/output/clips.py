"""Makes short clips of single runs, with estimates and truth drawn on the frames."""

import tempfile
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np

from jaxpf.evaluation.collection import ShownRun
from jaxpf.media.overlay import object_colours
from jaxpf.media.video_writer import VideoWriter
from jaxpf.targets.adapter import Adapter, Marks
from jaxpf.targets.target import Start

#: Clip sizes, largest first: the longer side in pixels, to which frames are resized, and the most
#: frames; longer runs show every second or third frame, and so on.
SIZES = ((400, 50), (400, 25), (300, 25))
#: Short clips are slowed down to last this many seconds, but not below this frame rate.
_SECONDS, _SLOWEST = 5.0, 4.0


class Clip(NamedTuple):
    """A playable clip.

    Attributes:
        data: content of a ``.webm`` file.
        width: pixels.
        height: pixels.
        step: the clip shows one frame in ``step``.
        rate: playback rate, frames per second.
    """

    data: bytes
    width: int
    height: int
    step: int
    rate: float


class Pictures(NamedTuple):
    """The frames of a clip in its size; memory does not grow with the sequence.

    Attributes:
        numbers: of the frames in the sequence.
        pictures: uint8 RGB ``[h, w, 3]`` each.
        factors: picture width over frame width, and the same for heights.
    """

    numbers: range
    pictures: list[np.ndarray]
    factors: tuple[float, float]


def read_pictures(frames: Any, size: tuple[int, int] = SIZES[0]) -> Pictures:
    """Read and resize only the frames that a clip shows.

    Args:
        frames: uint8 RGB ``[T, H, W, 3]``, or ``scenes.LazyFrames``.
        size: one of ``SIZES``.
    """
    side, most_frames = size
    numbers = range(0, len(frames), -(-len(frames) // most_frames))
    height, width = frames.shape[1:3]
    # Codecs need even sizes; the scales of both axes agree to within a pixel.
    scale = side / max(width, height)
    width, height = (2 * max(1, round(scale * side / 2)) for side in (width, height))
    kind = cv2.INTER_AREA if scale < 1 else cv2.INTER_CUBIC
    pictures = [
        cv2.resize(frame, (width, height), interpolation=kind) for frame in frames[:: numbers.step]
    ]
    return Pictures(numbers, pictures, (width / frames.shape[2], height / frames.shape[1]))


def make_clip(
    pictures: Pictures,
    truth: np.ndarray,
    shown: ShownRun,
    adapter: Adapter,
    start: Start,
    first_frame: int,
    fps: float,
) -> Clip:
    """Draw a run and encode it.

    Args:
        pictures: see ``read_pictures``.
        truth: ``[T, P, S]`` true shapes, drawn in white; NaN is not drawn.
        shown: the run; its shapes are drawn in the objects' colours.
        adapter: for the type of the objects.
        start: initial state of the objects.
        first_frame: number of the first frame, counted from 0.
        fps: frames per second of the source.

    Raises:
        InputError: there is no encoder, or no space for temporary files.
    """
    numbers = pictures.numbers
    rate = min(max(len(numbers) / _SECONDS, _SLOWEST), max(fps / numbers.step, _SLOWEST))
    height, width = pictures.pictures[0].shape[:2]
    colours = object_colours(start.num_partitions)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "clip.webm"
        with VideoWriter(path, width, height, rate) as video:
            for index, picture in zip(numbers, pictures.pictures, strict=True):
                there, shapes = adapter.scaled(start, truth[index], pictures.factors)
                picture = _draw_truth(picture, np.asarray(adapter.target.outlines(there, shapes)))
                there, shapes = adapter.scaled(start, shown.shapes[index], pictures.factors)
                picture = adapter.draw(picture, there, shapes, Marks(colours, shown.lost[index]))
                video.write(_number(picture, first_frame + index))
        data = path.read_bytes()
    return Clip(data, width, height, numbers.step, rate)


def _draw_truth(picture: np.ndarray, outlines: np.ndarray) -> np.ndarray:
    picture = picture.copy()
    for outline in outlines[np.isfinite(outlines).all(axis=(1, 2))]:
        points = [np.rint(outline - 0.5).astype(np.int32)]
        for colour, thickness in (((20, 20, 20), 3), ((255, 255, 255), 1)):
            cv2.polylines(picture, points, True, colour, thickness)
    return picture


def _number(picture: np.ndarray, frame: int) -> np.ndarray:
    """Write the frame's number into the lower left corner."""
    at = (6, picture.shape[0] - 7)
    for colour, thickness in (((20, 20, 20), 3), ((255, 255, 255), 1)):
        style = (cv2.FONT_HERSHEY_SIMPLEX, 0.45, colour, thickness, cv2.LINE_AA)
        cv2.putText(picture, f"frame {frame}", at, *style)
    return picture
