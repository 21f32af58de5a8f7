"""How programs read, write and draw a target, and which options they offer for it.

An adapter imports JAX and OpenCV only when it reads, draws or writes, so that the command line
can list its options quickly.
"""

import abc
import contextlib
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from jaxpf.targets.target import Looks, Start, Target


class Marks(NamedTuple):
    """How P shapes are drawn on a frame; a target uses what applies to it.

    Attributes:
        colours: uint8 RGB ``[P, 3]``.
        lost: bool ``[P]``, see ``jaxpf.contract.lost``.
        past: ``[L, P, S]``, shapes of the previous L frames, latest last, for trails.
        doubtful: bool ``[P]``, recovered and not yet confirmed; None if unknown.
    """

    colours: Any
    lost: Any
    past: Any = None
    doubtful: Any = None


class Adapter(abc.ABC):
    """How programs read, write and draw a target, and which options they offer for it.

    An adapter must define ``target``, ``read_start``, ``fits_scene``, ``scene_shapes``,
    ``scene_start`` and ``draw``; a class without them cannot be instantiated.  The other methods
    and the attributes below have defaults.

    Attributes:
        target: the target.
        start_flags: options of ``jaxpf track`` that say where objects start, name -> arguments of
            ``click.option``; ``read_start`` gets their values.
        example: arguments of ``jaxpf track`` after the video, for its help.
        columns: columns of tracks.csv that hold an object's position; angles in degrees, all
            others in pixels.
        fixed_columns: those columns that never change, and so have no interval.
    """

    target: Target
    start_flags: Mapping[str, Mapping[str, Any]] = {}
    example: str = ""
    columns: tuple[str, ...] = ("x", "y")
    fixed_columns: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """The target's name."""
        return self.target.name

    @abc.abstractmethod
    def read_start(self, given: Mapping[str, Any], number: int, source: Any) -> Start:
        """Read where the user's objects start.

        Args:
            given: values of ``start_flags``.
            number: index of the start frame, from 0.
            source: has ``width``, ``height`` and ``path``.

        Raises:
            InputError: no option was given, a file is unreadable, or an object is off the frame.
        """

    def later_starts(
        self, given: Mapping[str, Any], number: int, source: Any
    ) -> tuple[dict[int, Start], str | None]:
        """Objects that start, or start again, after the start frame ``number``.

        Returns:
            frame -> start, and a remark for the user or None.
        """
        return {}, None

    @abc.abstractmethod
    def fits_scene(self, scene: Any) -> bool:
        """Whether a scene's ground truth is of this kind."""

    @abc.abstractmethod
    def scene_shapes(self, scene: Any) -> np.ndarray:
        """A scene's ground truth ``[T, P, S]``, NaN where an object is absent."""

    @abc.abstractmethod
    def scene_start(self, scene: Any) -> Start:
        """Where the objects are in a scene's first frame."""

    def scaled(
        self, start: Start, shapes: np.ndarray, factors: tuple[float, float]
    ) -> tuple[Start, np.ndarray]:
        """Scale a start and shapes ``[..., P, S]`` by factors in x and y.

        The default assumes that a shape is a sequence of x, y pairs.
        """
        return start, shapes * np.tile(factors, shapes.shape[-1] // 2)

    def column_values(self, start: Start, shapes: np.ndarray) -> np.ndarray:
        """Values ``[..., P, C]`` of ``columns`` for shapes ``[..., P, S]``."""
        return shapes[..., :2]

    def outline_file(
        self, path: Any, start: Start
    ) -> contextlib.AbstractContextManager[Callable[[int, Any], None] | None]:
        """Open a new outlines.csv; as a context it is a function of a frame's number and shapes.

        By default there is no such file, and the context is None.
        """
        return contextlib.nullcontext()

    @abc.abstractmethod
    def draw(self, frame: Any, start: Start, shapes: Any, marks: Marks) -> np.ndarray:
        """The frame with the shapes drawn on it.

        Args:
            frame: uint8 RGB ``[H, W, 3]``.
            start: where tracking started.
            shapes: ``[P, S]``.
            marks: how each is drawn.
        """

    def draw_particles(
        self, frame: Any, start: Start, tracker: Any, state: Any, colours: Any
    ) -> np.ndarray:
        """The frame with a tracker's particles drawn on it, by default one dot each."""
        from jaxpf.media.overlay import draw_particles

        if not hasattr(state, "substates"):
            return frame
        centres = np.swapaxes(np.asarray(state.substates)[..., :2], 0, 1)
        return draw_particles(frame, centres, colours)


def looks_of_scene(scene: Any, num_particles: int, typical: Any = None) -> Looks:
    """A scene's reference patches and first frame, to learn a likelihood from."""
    return Looks(
        frame=None,
        patches=scene.patches,
        frame_shape=scene.frames.shape[1:3],
        num_particles=num_particles,
        typical=typical,
        surroundings=scene.frames[0],
        settings=scene.settings,
    )


#: Frames in a row with a start of one object, from which on a file holds whole tracks.
_WHOLE = 3


def starts_by_frame(
    frames: np.ndarray, names: np.ndarray, first: int, start_at: Callable[[int], Start]
) -> tuple[dict[int, Start], str | None]:
    """Starts by frame, after the first, of a file with one row per frame and object.

    A file that gives an object in three frames in a row holds whole tracks, not starts, and only
    its first frame counts.

    Args:
        frames: int ``[K]``, from 0.
        names: ``[K]``.
        first: the start frame.
        start_at: function from a frame to its objects.

    Returns:
        frame -> start, and a remark for the user or None.
    """
    rows = set(zip(frames.tolist(), names.tolist(), strict=True))
    if any(all((at + step, name) in rows for step in range(_WHOLE)) for at, name in rows):
        return {}, f"the start file holds whole tracks; only its frame {first} is used."
    return {int(at): start_at(int(at)) for at in np.unique(frames[frames > first])}, None
