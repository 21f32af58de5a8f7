"""Films of few small frames in any codec, written by PyAV."""

import itertools
import os
from fractions import Fraction

import av
import numpy as np


def moving_square(number, size=(64, 48)):
    """A red square that moves by 4 pixels a frame over a grey ramp, uint8 RGB."""
    width, height = size
    ramp = np.linspace(40, 200, width).astype(np.uint8)
    frame = np.broadcast_to(ramp[:, None], (height, width, 3)).copy()
    frame[8 : height // 2, 4 + 4 * number : 20 + 4 * number] = (220, 40, 40)
    return frame


def write_film(
    path,
    frames,
    codec="libx264",
    pixels="yuv420p",
    options=None,
    rate=25,
    stamps=None,
    form=None,
    prepare=lambda stream: None,
    container_options=None,
):
    """Encode RGB frames, shown after ``stamps`` milliseconds; ``prepare`` sets the stream."""
    frames = iter(frames)
    first = next(frames)
    with av.open(os.path.abspath(path), "w", format=form, options=container_options or {}) as file:
        stream = file.add_stream(codec, rate=rate)
        stream.height, stream.width = first.shape[:2]
        stream.pix_fmt, stream.options = pixels, options or {}
        if stamps is not None:
            stream.codec_context.time_base = Fraction(1, 1000)
        prepare(stream)
        for number, frame in enumerate(itertools.chain([first], frames)):
            picture = av.VideoFrame.from_ndarray(frame, "rgb24")
            if stamps is not None:
                picture.pts, picture.time_base = stamps[number], Fraction(1, 1000)
            file.mux(stream.encode(picture))
        file.mux(stream.encode(None))
    if codec == "libsvtav1" and hasattr(os, "sched_setscheduler"):
        # As root it gives the process real-time priority, which would starve all others.
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    return path
