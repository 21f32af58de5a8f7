"""A clip of two rectangles on the move, and what the command line makes of it."""

import json

import cv2
import numpy as np
from clips import write_table

from jaxpf.boxes import read_boxes

WIDTH, HEIGHT, LENGTH = 64, 48, 10
COLOURS = ((220, 30, 30), (30, 40, 220))
# Every successful run has these shapes, so that the filter is compiled once.
PARTICLES = ("-n", "60")
#: When the pictures of a film are shown, in milliseconds: it stops for a minute.
STAMPS = [40 * number + 60_000 * (number > 4) for number in range(LENGTH)]
BOXES = ("--box", "6,8,12,16", "--box", "40,22,12,16")


def true_boxes(time):
    return np.array([[6 + 2 * time, 8 + time, 12, 16], [40 - time, 22 - time, 12, 16]])


def picture(time, noise=True):
    """Two coloured rectangles over grey."""
    frame = np.full((HEIGHT, WIDTH, 3), 110, np.uint8)
    if noise:
        frame = np.random.default_rng(time).integers(90, 130, frame.shape, dtype=np.uint8)
    for (x, y, w, h), colour in zip(true_boxes(time), COLOURS, strict=True):
        frame[y : y + h, x : x + w] = colour
    return frame


def write_lossless_video(path, frames):
    fourcc = cv2.VideoWriter.fourcc(*"FFV1")
    writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, fourcc, 25, (WIDTH, HEIGHT))
    for frame in frames:
        writer.write(cv2.cvtColor(frame, cv2.COLOR_RGB2BGR))
    writer.release()
    return path


def write_truth(path, ids=(1, 2), last=LENGTH):
    rows = (
        (number, identity, box, 0)
        for number in range(last)
        for identity, box in zip(ids, true_boxes(number), strict=True)
    )
    return write_table(path, "frame,id,x,y,w,h,occ", *rows)


def rows_of(output, name="tracks.csv"):
    """Frame, id, x, y, w, h and confidence of every row, counting from 0."""
    table = read_boxes(output / name)
    return np.column_stack([table.frame, table.id, table.box, table.confidence])


def summary_of(output):
    return json.loads((output / "summary.json").read_text())
