"""Reads contours from JSON; writes and draws them."""

import contextlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

from jaxpf.contours.data import Contours
from jaxpf.contours.target import CONTOURS, PIECES, contour_start, polylines
from jaxpf.contract.errors import InputError
from jaxpf.shapes.splines import basis, even_places, fit_spline, resampled
from jaxpf.targets.adapter import Adapter, Marks
from jaxpf.targets.target import Start

#: Number of control points of a scene's contours, closed and open.
_SCENE_POINTS = {True: 16, False: 8}
#: Number of particles to draw, those with the largest weights.
_DRAWN = 20


class ContourAdapter(Adapter):
    """See ``Adapter``."""

    target = CONTOURS
    example = "--contours wires.json --sigma 3"
    start_flags: Mapping[str, Mapping[str, Any]] = {
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
    }

    def read_start(self, given: Mapping[str, Any], number: int, source: Any) -> Start:
        """See ``Adapter``."""
        from jaxpf.contours.files import read_contours

        if not given["contours"]:
            raise InputError(
                "no start contour: give --contours FILE.json with control points.  Draw contours "
                f"with `jaxpf mark {source.path} --target contours`."
            )
        contours = read_contours(given["contours"])
        learned = None
        if given["learned"]:
            from jaxpf.contours.learned_files import read_learned

            learned = read_learned(given["learned"])
        start = contour_start(contours, learned)
        for name, line in zip(contours.names, polylines(start.shapes), strict=True):
            seen = (line >= 0) & (line < (source.width, source.height))
            if not seen.all(axis=1).any():
                raise InputError(
                    f"contour '{name}' lies outside the frame of {source.width} x {source.height} "
                    "pixels: move it inside, or leave it out."
                )
        return start

    def fits_scene(self, scene: Any) -> bool:
        """Whether the ground truth has outlines."""
        return {"outlines", "closed"} <= set(scene.extras)

    def scene_shapes(self, scene: Any) -> np.ndarray:
        """See ``Adapter``."""
        closed = bool(scene.extras["closed"])
        outlines = np.asarray(scene.extras["outlines"], float)
        lines = [_polyline(line, closed) for pair in outlines for line in pair]
        return np.reshape(lines, (*outlines.shape[:2], -1))

    def scene_start(self, scene: Any) -> Start:
        """See ``Adapter``: splines fitted to the outlines of the first frame."""
        closed = bool(scene.extras["closed"])
        outlines = scene.extras["outlines"][0]
        points = [fit_spline(line, _SCENE_POINTS[closed], closed=closed) for line in outlines]
        names = scene.extras.get("ids", range(1, len(outlines) + 1))
        width = None if closed else scene.parameters.get("wire_width")
        return contour_start(
            Contours(tuple(map(str, names)), np.array(points), closed=closed, width=width)
        )

    def column_values(self, start: Start, shapes: np.ndarray) -> np.ndarray:
        """See ``Adapter``: the mean of the outline's points."""
        return polylines(shapes).mean(axis=-2)

    @contextlib.contextmanager
    def outline_file(self, path: Any, start: Start) -> Iterator[Callable[[int, Any], None]]:
        """See ``Adapter``: CSV with the header ``frame,contour,kind,point,x,y``."""
        from jaxpf.contours.files import ContourTrackWriter

        inverse = np.zeros((0, PIECES + 1))  # without splines there are no control points
        contours = getattr(start, "contours", None)
        if contours is not None:
            places = even_places(PIECES + 1, closed=False)
            kind: dict[str, Any] = {"closed": contours.closed, "degree": contours.degree}
            # The control points follow from the points on the spline, which are more.
            inverse = np.linalg.pinv(basis(places, contours.points.shape[1], **kind))

        with ContourTrackWriter(path) as writer:

            def append(frame: int, shapes: Any) -> None:
                lines = polylines(np.asarray(shapes, float))
                writer.append(frame, start.ids, inverse @ lines, lines)

            yield append

    def draw(self, frame: Any, start: Start, shapes: Any, marks: Marks) -> np.ndarray:
        """See ``Adapter``."""
        from jaxpf.media.overlay import draw_outlines

        lines = polylines(np.asarray(shapes))
        return draw_outlines(frame, lines, start.ids, marks.colours, marks.lost, marks.doubtful)

    def draw_particles(
        self, frame: Any, start: Start, tracker: Any, state: Any, colours: Any
    ) -> np.ndarray:
        """See ``Adapter``: contours of the likeliest particles, occluded parts dark and dashed."""
        from jaxpf.contours.drawing import draw_contour_particles

        log_weights = np.asarray(state.log_weights)
        best = np.argsort(log_weights)[::-1][:_DRAWN]
        lines = polylines(CONTOURS.shapes(start, np.asarray(state.substates)[best], tracker))
        hidden, orders = None, getattr(tracker.likelihood, "orders_of_labels", None)
        if getattr(state, "label", None) is not None and orders is not None:
            hidden = _hidden(lines, [orders[label] for label in np.asarray(state.label)[best]])
        return draw_contour_particles(frame, lines, np.exp(log_weights[best]), hidden, colours)


ADAPTER = ContourAdapter()


def _polyline(outline: np.ndarray, closed: bool) -> np.ndarray:
    """A shape ``[2 V]`` from an outline ``[S, 2]``; NaN where it is not finite."""
    if not np.isfinite(outline).all():
        return np.full(2 * (PIECES + 1), np.nan)
    even = resampled(outline, PIECES + (not closed), closed=closed)
    return np.concatenate([even, even[:1]] if closed else [even]).ravel()


def _hidden(lines: np.ndarray, orders: Sequence[Sequence[int]]) -> np.ndarray:
    """Which points of ``[n, P, V, 2]`` lie inside a nearer contour, by orders, nearest first."""
    import cv2

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
