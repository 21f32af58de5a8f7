"""Contours as a kind of target: their files, truth and pictures.

A shape is a polyline x, y, x, y, ... in pixels; a closed contour's last point equals its first.
"""

import dataclasses
import os
from collections.abc import Mapping, Sequence
from itertools import combinations
from pathlib import Path
from typing import Any

import cv2
import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from jaxpf.contours.drawing import draw_contour_particles
from jaxpf.contours.factory import PIECES, polylines, start, to_contours, tracker
from jaxpf.contours.files import Contours, read_contours, read_learned
from jaxpf.contract.calls import optional
from jaxpf.contract.errors import InputError
from jaxpf.files.writing import LineWriter
from jaxpf.measures.polylines import measure_polylines
from jaxpf.media.film import FrameSource
from jaxpf.media.overlay import draw_outlines
from jaxpf.shapes.splines import fit_spline, resample_polyline
from jaxpf.targets.target import Marks, Start, Target
from scenes import Scene

#: Header of outlines.csv.
TRACK_HEADER = "frame,id,k,x,y,kind"
#: Number of control points of a scene's contours, closed and open.
_SCENE_POINTS = {True: 16, False: 8}
#: Number of particles to draw, those with the largest weights.
_DRAWN = 20


def _shapes(start: Start, estimate: ArrayLike, tracker: Any) -> np.ndarray:
    lines = to_contours(tracker, estimate)
    return lines.reshape(*lines.shape[:-2], -1)


def _outlines(shapes: ArrayLike, sizes: ArrayLike) -> jax.Array:
    """Polylines there and back, so that closing the polygon adds no line.

    These outlines are not convex; ``measures`` accounts for that.
    """
    lines = _lines(jnp.asarray(shapes))
    return jnp.concatenate([lines, jnp.flip(lines, axis=-2)], axis=-2)


def _measures(shapes: ArrayLike, truth: ArrayLike) -> dict[str, Any]:
    return measure_polylines(_lines(jnp.asarray(shapes)), _lines(jnp.asarray(truth)))


def _read_start(given: Mapping[str, Any], number: int, source: FrameSource) -> Start:
    if not given["contours"]:
        raise InputError(
            "no start contour: give --contours FILE.json with control points.  Draw contours "
            f"with `jaxpf mark {source.path} --target contours`."
        )
    contours = read_contours(given["contours"])
    learned = read_learned(given["learned"]) if given["learned"] else None
    begun = dataclasses.replace(start(contours), learned=learned)
    for name, line in zip(contours.names, _lines(begun.shapes), strict=True):
        seen = (line >= 0) & (line < (source.width, source.height))
        if not seen.all(axis=1).any():
            raise InputError(
                f"contour '{name}' lies outside the frame of {source.width} x {source.height} "
                "pixels: move it inside, or leave it out."
            )
    return begun


def _scene_shapes(scene: Scene) -> np.ndarray | None:
    if not {"outlines", "closed"} <= set(scene.extras):
        return None
    closed = bool(scene.extras["closed"])
    outlines = np.asarray(scene.extras["outlines"], float)
    lines = [_polyline(line, closed) for pair in outlines for line in pair]
    return np.reshape(lines, (*outlines.shape[:2], -1))


def _scene_start(scene: Scene) -> Start:
    """Splines fitted to the outlines of the first frame."""
    closed = bool(scene.extras["closed"])
    outlines = scene.extras["outlines"][0]
    points = [fit_spline(line, _SCENE_POINTS[closed], closed=closed) for line in outlines]
    names = scene.extras.get("ids", range(1, len(outlines) + 1))
    width = None if closed else scene.parameters.get("wire_width")
    return start(Contours(tuple(map(str, names)), np.array(points), closed=closed, width=width))


def _column_values(start: Start, shapes: np.ndarray) -> np.ndarray:
    """The mean of the outline's points."""
    return _lines(shapes).mean(axis=-2)


class OutlineFile(LineWriter):
    """An outlines.csv, which after every frame contains whole lines only.

    Every contour has points of kind ``control``, usable as start contours, and of kind ``outline``,
    for drawing.  A stored evaluation knows of no splines, and so of no control points.
    """

    header = TRACK_HEADER

    def __init__(self, path: str | os.PathLike[str], start: Start):
        super().__init__(path)
        self._names, self._inverse = start.ids, np.zeros((0, PIECES + 1))
        if (contours := getattr(start, "contours", None)) is not None:
            # The control points follow from the points on the spline, which are more.
            each = np.eye(contours.points.shape[1])
            self._inverse = np.linalg.pinv(polylines(each, contours.closed, contours.degree))

    def __call__(self, frame: int, shapes: np.ndarray) -> None:
        """Write the shapes of one frame; a target with a non-finite point is omitted."""
        lines = _lines(np.asarray(shapes, float))
        kinds = {"control": self._inverse @ lines, "outline": lines}
        self.write_rows(
            [frame, name, number, f"{x:.3f}", f"{y:.3f}", kind]
            for target, name in enumerate(self._names)
            if np.isfinite(lines[target]).all()
            for kind, points in kinds.items()
            for number, (x, y) in enumerate(points[target])
        )


def _draw(frame: np.ndarray, start: Start, shapes: np.ndarray, marks: Marks) -> np.ndarray:
    lines = _lines(np.asarray(shapes))
    return draw_outlines(frame, lines, start.ids, marks.colours, marks.lost, marks.doubtful)


def _draw_particles(
    frame: np.ndarray, start: Start, tracker: Any, state: Any, colours: np.ndarray
) -> np.ndarray:
    """Contours of the likeliest particles, occluded parts dark and dashed."""
    log_weights = np.asarray(state.log_weights)
    best = np.argsort(log_weights)[::-1][:_DRAWN]
    lines = _lines(_shapes(start, np.asarray(state.substates)[best], tracker))
    hidden, orders = None, optional(tracker.likelihood, "orders_of_labels")
    if getattr(state, "label", None) is not None and orders is not None:
        hidden = _hidden(lines, [orders[label] for label in np.asarray(state.label)[best]])
    return draw_contour_particles(frame, lines, np.exp(log_weights[best]), hidden, colours)


def _lines(shapes: Any) -> Any:
    """Reshape shapes ``[..., P, 2 V]`` to polylines ``[..., P, V, 2]``."""
    return shapes.reshape(*shapes.shape[:-1], -1, 2)


def _polyline(outline: np.ndarray, closed: bool) -> np.ndarray:
    """A shape ``[2 V]`` from an outline ``[S, 2]``; NaN where it is not finite."""
    if not np.isfinite(outline).all():
        return np.full(2 * (PIECES + 1), np.nan)
    even = resample_polyline(outline, PIECES + (not closed), closed=closed)
    return np.concatenate([even, even[:1]] if closed else [even]).ravel()


def _hidden(lines: np.ndarray, orders: Sequence[Sequence[int]]) -> np.ndarray:
    """Which points of ``[n, P, V, 2]`` lie inside a nearer contour, by orders, nearest first."""
    is_hidden = np.zeros(lines.shape[:3], bool)
    for hidden, outlines, order in zip(is_hidden, lines, orders, strict=True):
        for nearer, farther in combinations(order, 2):
            if np.isfinite(outlines[[nearer, farther]]).all():
                outline = outlines[nearer].astype(np.float32)[:, None]
                hidden[farther] |= [
                    cv2.pointPolygonTest(outline, (float(x), float(y)), False) > 0
                    for x, y in outlines[farther]
                ]
    return is_hidden


CONTOURS = Target(
    name="contours",
    tracker=tracker,
    start=start,
    shapes=_shapes,
    outlines=_outlines,
    measure=_measures,
    read_start=_read_start,
    scene_shapes=_scene_shapes,
    scene_start=_scene_start,
    column_values=_column_values,
    outline_file=OutlineFile,
    draw=_draw,
    draw_particles=_draw_particles,
    defaults={"method": "ps", "num_particles": 500},
    unsuited=("sps",),  # exclusion weighs contours together
    example="--contours wires.json --sigma 3",
    start_flags={
        "contours": {
            "type": Path,
            "help": "JSON of start contours, control points of splines in pixels.  Such as "
            '{"closed": true, "contours": {"leaf": [[10, 20], [30, 18], [32, 40], [12, 38]]}}; for '
            'wires "closed": false and "width": their width.',
        },
        "learned": {
            "type": Path,
            "help": "Shape space and dynamics of contours, from `jaxpf contour learn`.",
        },
    },
)
