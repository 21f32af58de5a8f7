"""Pictures, and files that say where objects start, as small as a test needs."""

import json

import cv2
import numpy as np


def grey(level, size=(64, 48)):
    """A picture ``[H, W, 3]`` of one level."""
    return np.full((size[1], size[0], 3), level, np.uint8)


def write_pictures(folder, frames, name="{}.png", first=0):
    """RGB, RGBA or grey pictures as numbered files.

    Args:
        folder: is made, and returned.
        frames: one or more.
        name: of a file, with a place for its number, such as ``{:04d}.png``.
        first: number.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for number, frame in enumerate(frames, first):
        picture = frame if frame.ndim == 2 else frame[..., [2, 1, 0, 3][: frame.shape[2]]]
        assert cv2.imwrite(str(folder / name.format(number)), picture)
    return folder


def write_table(path, header, *rows):
    """A CSV file; fields of a row that are sequences are several fields."""
    lines = [",".join(str(x) for field in row for x in _fields(field)) for row in rows]
    path.write_text("\n".join([header, *lines]) + "\n", encoding="utf-8")
    return path


def _fields(field):
    return np.asarray(field).tolist() if isinstance(field, (list, tuple, np.ndarray)) else [field]


def write_starts(path, *rows):
    """Boxes ``(frame, id, box)`` as a start file has them."""
    return write_table(path, "frame,id,x,y,w,h", *rows)


def write_parts(path, *rows):
    """Parts ``(name, parent, x, y, w, h, angle)``."""
    return write_table(path, "part,parent,x,y,w,h,angle", *rows)


def write_contours(path, contours, closed=True, **more):
    """Control points by name."""
    points = {name: np.asarray(line).tolist() for name, line in contours.items()}
    path.write_text(json.dumps({"closed": closed, "contours": points, **more}))
    return path
