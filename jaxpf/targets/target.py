"""A kind of target: the factory of its trackers, and what programs need to read and draw it."""

import contextlib
import dataclasses
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, Self

import numpy as np

from jaxpf.contract.errors import InputError
from jaxpf.files.reading import check_pixels
from jaxpf.measures.outlines import measure_outlines
from jaxpf.media.film import FrameSource
from jaxpf.media.overlay import draw_particles
from scenes import Scene

#: Frames in a row with a start of one object, from which on a file holds whole tracks.
_WHOLE = 3


@dataclasses.dataclass(frozen=True, eq=False)
class Start:
    """Where P objects are in the start frame.

    A *shape* is what a target reports for one object in one frame, S numbers: a box or a pose.

    Attributes:
        ids: ``[P]``, numbers or names of the objects.
        shapes: float64 ``[P, S]``.
        sizes: float64 ``[P, 2]``, width and height in pixels of the objects at the start.
        parents: the part tree, -1 for a root.
        reach: half-width of the uniform distribution around the shapes from which particles start,
            ``[]`` or ``[S]``; used by parts only.
        later: frame -> objects that start, or start again, there.
        remarks: warnings about input that was accepted but may be a mistake.
    """

    ids: np.ndarray
    shapes: np.ndarray
    sizes: np.ndarray
    parents: tuple[int, ...]
    _: dataclasses.KW_ONLY
    reach: Any = 0.0
    later: "Mapping[int, Start]" = dataclasses.field(default_factory=dict)
    remarks: tuple[str, ...] = ()

    @property
    def num_partitions(self) -> int:
        """P, the number of objects."""
        return len(self.parents)

    @classmethod
    def from_rows(
        cls, frames: np.ndarray, names: np.ndarray, first: int, start_at: Callable[[int], Self]
    ) -> Self:
        """The objects of frame ``first`` and of later ones, by a file's rows per frame and object.

        A file that gives an object in three frames in a row holds whole tracks, not starts, and
        only its first frame counts.

        Args:
            frames: int ``[K]``, from 0.
            names: ``[K]``.
            first: the start frame.
            start_at: function from a frame to its objects.
        """
        start = start_at(first)
        if holds_whole_tracks(set(zip(frames.tolist(), names.tolist(), strict=True))):
            remark = f"the start file holds whole tracks; only its frame {first} is used."
            return dataclasses.replace(start, remarks=(*start.remarks, remark))
        later = {int(at): start_at(int(at)) for at in np.unique(frames[frames > first])}
        return dataclasses.replace(start, later=later)


def holds_whole_tracks(rows: set[tuple[int, Any]]) -> bool:
    """Whether an object has rows ``(frame, name)`` in three frames in a row."""
    return any(all((at + step, name) in rows for step in range(_WHOLE)) for at, name in rows)


def check_inside(
    what: str, names: Iterable[object], places: np.ndarray, source: FrameSource
) -> None:
    """Refuse x and y ``[P, 2]`` outside the frame; ``what`` they are, such as ``"point"``."""
    check_pixels("the start points", places)
    for name, (x, y) in zip(names, places, strict=True):
        if not (0 <= x < source.width and 0 <= y < source.height):
            raise InputError(
                f"{what} '{name}' is at ({x:g}, {y:g}), outside the frame of {source.width} x "
                f"{source.height} pixels: move it inside, or leave it out."
            )


class Looks(NamedTuple):
    """What a likelihood is learned from.

    Attributes:
        frame: uint8 RGB ``[H, W, 3]``, the start frame, with objects and surroundings.
        patches: P upright pictures of the objects, uint8 RGB ``[h, w, 3]``, which take precedence
            over the frame; None learns from the frame.
        num_particles: particles of one run, for choices that depend on cost.
        typical: uint8 RGB ``[n, H, W, 3]``, typical frames, from which clutter is learned; by
            default the start frame.
        settings: values for options that the user leaves open, of a scene that brings some.
        background: uint8 RGB ``[n, H, W, 3]``.  If given, the likelihood is one to tune: relative
            to that of objects anywhere in these frames, and differentiable in its parameters and
            the state.
    """

    frame: Any
    patches: Sequence[np.ndarray] | None = None
    num_particles: int = 300
    typical: np.ndarray | None = None
    settings: Mapping[str, Any] = {}
    background: np.ndarray | None = None


class Marks(NamedTuple):
    """How P shapes are drawn on a frame; a target uses what applies to it.

    Attributes:
        colours: uint8 RGB ``[P, 3]``.
        lost: bool ``[P]``, see ``jaxpf.contract.lost``.
        past: ``[L, P, S]``, shapes of the previous L frames, latest last, for trails.
        doubtful: bool ``[P]``, recovered and not yet confirmed; None if unknown.
    """

    colours: np.ndarray
    lost: np.ndarray
    past: np.ndarray | None = None
    doubtful: np.ndarray | None = None


def _no_start(scene: Scene) -> Start:
    raise InputError(f"the objects of scene {scene.name!r} cannot be started from its truth.")


def _dots(frame: np.ndarray, start: Start, tracker: Any, state: Any, colours: Any) -> np.ndarray:
    """The frame with one dot for every particle."""
    if not hasattr(state, "substates"):
        return frame
    centres = np.swapaxes(np.asarray(state.substates)[..., :2], 0, 1)
    return draw_particles(frame, centres, colours)


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Target:
    """A kind of target, for ``jaxpf.targets.register``.

    Attributes:
        name: on the command line.
        tracker: function of a frame (or ``Looks``), what ``start`` takes (or a ``Start``), and
            annotated options (``jaxpf.contract.options``), which returns a tracker.  It hands
            ``**options`` on to ``jaxpf.filters.build``.
        start: function of the tracker's second argument that returns a ``Start``.
        read_start: function of the values of ``start_flags``, the index of the start frame and the
            video (``width``, ``height``, ``path``) that returns the ``Start``.
        outlines: function of shapes ``[..., P, S]`` and sizes at the start ``[P, 2]`` that returns
            corners ``[..., P, V, 2]`` of convex polygons, in order, in pixels; differentiable, and
            of estimates, too, if ``can_be_tuned`` and shapes are no boxes.
        draw: function of a frame, start, shapes ``[P, S]`` and ``Marks`` that returns the picture.
        shapes: function of start, estimates ``[..., P, D]`` and tracker that returns their shapes
            ``[..., P, S]``.
        settle: function of values of the options, settings of a scene (``Looks.settings``) and the
            number of objects or None, that returns the values with those that were left open.
        scene_shapes: function of a scene that returns its truth ``[T, P, S]``, NaN where an object
            is absent; None if its truth is of another kind.
        scene_start: function of such a scene that returns where objects are in its first frame.
        measure: function of shapes and truth that returns error measures per frame, with or without
            ``corner_error``; by default those of the outlines, ``jaxpf.measures.outlines``.
        columns: of tracks.csv that hold an object's position; angles in degrees, others in pixels.
        fixed_columns: those that never change, and so have no interval.
        column_values: function of start and shapes that returns their values ``[..., P, C]``.
        outline_file: function of a path and start that opens a new outlines.csv, as a context that
            is a function of a frame's number and shapes, or None.
        draw_particles: function of a frame, start, tracker, state and colours.
        can_be_tuned: whether ``tracker`` takes note of ``Looks.background``.
        has_boxes: whether shapes are boxes x, y, w, h, as in MOT files and standard scores.
        has_places: whether a substate begins with x and y, a position or its shift in pixels.
        place: what the interval that a verdict names is of.
        defaults: defaults of the options of its default filter that differ from the filter's.
        systems: published systems (``like``) with a builder of their own, paper -> function of
            frame, shapes and settings.
        unsuited: methods that refuse such targets, so that help and evaluations leave them out.
        start_flags: flags of ``jaxpf track`` that say where objects start, name -> arguments of
            ``click.option``.
        example: arguments of ``jaxpf track`` after the video, for its help.
    """

    name: str
    tracker: Callable[..., Any]
    start: Callable[..., Start]
    read_start: Callable[[Mapping[str, Any], int, FrameSource], Start]
    outlines: Callable[[Any, Any], Any]
    draw: Callable[[np.ndarray, Start, np.ndarray, Marks], np.ndarray]
    shapes: Callable[[Start, Any, Any], np.ndarray] = lambda start, estimate, tracker: np.asarray(
        estimate
    )
    settle: Callable[..., dict[str, Any]] = lambda values, settings, num_objects=None: {**values}
    scene_shapes: Callable[[Scene], Any] = lambda scene: None
    scene_start: Callable[[Scene], Start] = _no_start
    measure: Callable[[Any, Any], dict[str, Any]] | None = None
    columns: tuple[str, ...] = ("x", "y")
    fixed_columns: tuple[str, ...] = ()
    column_values: Callable[[Start, np.ndarray], np.ndarray] = lambda start, shapes: shapes[..., :2]
    outline_file: Callable[[Path, Start], Any] = lambda path, start: contextlib.nullcontext()
    draw_particles: Callable[..., np.ndarray] = _dots
    can_be_tuned: bool = False
    has_boxes: bool = False
    has_places: bool = True
    place: str = "centre"
    defaults: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    systems: Mapping[str, Callable[..., Any]] = dataclasses.field(default_factory=dict)
    unsuited: tuple[str, ...] = ()
    start_flags: Mapping[str, Mapping[str, Any]] = dataclasses.field(default_factory=dict)
    example: str = ""

    def centres(self, values: np.ndarray) -> np.ndarray:
        """x and y of the centre ``[..., 2]``, of values of ``columns``."""
        corner = values[..., :2]
        return corner + values[..., 2:4] / 2 if self.has_boxes else corner

    def is_told_boxes_by(self, tracker: object) -> bool:
        """Whether a tracker of somebody else converts its estimates to boxes itself."""
        return self.has_boxes and hasattr(tracker, "boxes")

    def measures(self, shapes: Any, truth: Any, sizes: Any) -> dict[str, Any]:
        """Error measures per frame of shapes ``[..., P, S]``."""
        if self.measure is not None:
            return self.measure(shapes, truth)
        return measure_outlines(self.outlines(shapes, sizes), self.outlines(truth, sizes))
