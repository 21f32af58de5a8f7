"""Short clips of single runs: estimates and truth drawn on the frames."""

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from jaxpf.evaluation.collection import ShownRun
from jaxpf.media.overlay import draw_boxes, object_colours
from jaxpf.media.video_writer import VideoWriter

#: Sizes of a clip, large ones first: its longer side in pixels, to which frames are enlarged or
#: reduced, and its frames at most, of which a longer run shows every second, or third, and so on.
SIZES = ((400, 50), (400, 25), (300, 25))
#: A clip of few frames is slowed down to last so long, but not below so many frames a second.
_SECONDS, _SLOWEST = 5.0, 4.0


class Clip(NamedTuple):
    """A playable clip.

    Attributes:
        data: of a ``.webm`` file.
        width: pixels.
        height: pixels.
        step: every so manieth frame is in it.
        rate: frames per second at which it plays.
    """

    data: bytes
    width: int
    height: int
    step: int
    rate: float


def make_clip(
    frames: np.ndarray,
    truth: np.ndarray,
    shown: ShownRun,
    ids: Sequence[int],
    first_frame: int,
    fps: float,
    size: tuple[int, int] = SIZES[0],
) -> Clip:
    """Draw a run and encode it.

    Args:
        frames: uint8 RGB ``[T, H, W, 3]``.
        truth: ``[T, P, 4]`` boxes, drawn thin and white.
        shown: the run; its boxes are drawn in the colours of the objects.
        ids: numbers of the P objects.
        first_frame: number of the first frame, from 0; the others follow.
        fps: frames per second of the source.
        size: one of ``SIZES``.

    Raises:
        InputError: no encoder, or no space for temporary files.
    """
    side, most_frames = size
    step = -(-len(frames) // most_frames)
    chosen = range(0, len(frames), step)
    rate = min(max(len(chosen) / _SECONDS, _SLOWEST), max(fps / step, _SLOWEST))
    height, width = frames.shape[1:3]
    # Even sizes, which the codecs need; the same in both directions to within a pixel.
    scale = side / max(width, height)
    width, height = (2 * max(1, round(scale * side / 2)) for side in (width, height))
    factors = np.array([width, height, width, height]) / np.tile(frames.shape[2:0:-1], 2)
    colours = object_colours(len(ids))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "clip.webm"
        with VideoWriter(path, width, height, rate, codec="vp8") as video:
            for index in chosen:
                kind = cv2.INTER_AREA if scale < 1 else cv2.INTER_CUBIC
                picture = cv2.resize(frames[index], (width, height), interpolation=kind)
                picture = _draw_truth(picture, truth[index] * factors)
                boxes = shown.boxes[index] * factors
                picture = draw_boxes(picture, boxes, list(ids), colours, shown.lost[index])
                video.write(_number(picture, first_frame + index))
        data = path.read_bytes()
    return Clip(data, width, height, step, rate)


def _draw_truth(picture: np.ndarray, boxes: np.ndarray) -> np.ndarray:
    picture = picture.copy()
    for x, y, w, h in boxes[np.isfinite(boxes).all(axis=1)]:
        corners = (round(x), round(y)), (round(x + w) - 1, round(y + h) - 1)
        for colour, thickness in (((20, 20, 20), 3), ((255, 255, 255), 1)):
            cv2.rectangle(picture, *corners, colour, thickness)
    return picture


def _number(picture: np.ndarray, frame: int) -> np.ndarray:
    """Write the frame's number into the lower left corner."""
    at = (6, picture.shape[0] - 7)
    for colour, thickness in (((20, 20, 20), 3), ((255, 255, 255), 1)):
        style = (cv2.FONT_HERSHEY_SIMPLEX, 0.45, colour, thickness, cv2.LINE_AA)
        cv2.putText(picture, f"frame {frame}", at, *style)
    return picture
