"""Short clips of single runs: estimates and truth drawn on the frames."""

import tempfile
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from jaxpf.evaluation.collection import ShownRun
from jaxpf.media.overlay import object_colours
from jaxpf.media.video_writer import VideoWriter
from jaxpf.targets.target import Start, Target

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
    target: Target,
    start: Start,
    first_frame: int,
    fps: float,
    size: tuple[int, int] = SIZES[0],
) -> Clip:
    """Draw a run and encode it.

    Args:
        frames: uint8 RGB ``[T, H, W, 3]``.
        truth: ``[T, P, S]`` shapes, whose outlines are drawn thin and white.
        shown: the run; its shapes are drawn in the colours of the objects.
        target: what the objects are.
        start: where they were at first.
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
    factors = width / frames.shape[2], height / frames.shape[1]
    colours = object_colours(start.num_partitions)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "clip.webm"
        with VideoWriter(path, width, height, rate) as video:
            for index in chosen:
                kind = cv2.INTER_AREA if scale < 1 else cv2.INTER_CUBIC
                picture = cv2.resize(frames[index], (width, height), interpolation=kind)
                there, shapes = target.scaled(start, truth[index], factors)
                picture = _draw_truth(picture, np.asarray(target.outlines(there, shapes)))
                there, shapes = target.scaled(start, shown.shapes[index], factors)
                picture = target.draw(picture, there, shapes, colours, shown.lost[index])
                video.write(_number(picture, first_frame + index))
        data = path.read_bytes()
    return Clip(data, width, height, step, rate)


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
