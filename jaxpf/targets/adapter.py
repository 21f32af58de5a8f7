"""How programs read, write and draw a target, and which options they offer for it.

An adapter imports JAX and OpenCV only when it reads, draws or writes, so that the command line
can list its options quickly.
"""

import abc
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from jaxpf.targets.target import Looks, Start, Target


class Marks(NamedTuple):
    """How P shapes are drawn on a frame; a target uses what applies to it.

    Attributes:
        colours: uint8 RGB ``[P, 3]``.
        lost: bool ``[P]``.
        past: ``[L, P, S]``, shapes of the previous L frames, latest last, for trails.
        doubtful: bool ``[P]``, probably lost; None if unknown.
    """

    colours: Any
    lost: Any
    past: Any = None
    doubtful: Any = None

    @property
    def unsure(self) -> Any:
        """bool ``[P]``, whether an object is lost or probably lost."""
        return self.lost if self.doubtful is None else self.lost | self.doubtful


class OutlineFile:
    """A file of outlines, written frame by frame; use it as a context manager.

    Attributes:
        append: function of (frame, shapes ``[P, S]``).
    """

    def __init__(self, writer: Any, append: Callable[[int, Any], None]):
        self._writer, self.append = writer, append

    def __enter__(self) -> "OutlineFile":
        self._writer.__enter__()
        return self

    def __exit__(self, *exception: Any) -> Any:
        return self._writer.__exit__(*exception)


class Adapter(abc.ABC):
    """How programs read, write and draw a target, and which options they offer for it.

    An adapter must define ``target``, ``read_start``, ``fits_scene``, ``scene_shapes``,
    ``scene_start`` and ``draw``; a class without them cannot be instantiated.  ``scaled``,
    ``widened``, ``outline_file``, ``draw_particles`` and the attributes below have defaults.

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

    def widened(self, values: np.ndarray, interval: np.ndarray, likelihood: Any) -> np.ndarray:
        """Add errors that the particles do not show to 95 % intervals; by default none.

        Args:
            values: ``[P, C]``, estimates of the columns.
            interval: ``[2, P, C]``, quantiles of the particles.
            likelihood: the tracker's, or None.
        """
        return interval

    def outline_file(self, path: Any, start: Start) -> OutlineFile | None:
        """A new file for the outlines of the objects of ``start``; by default none.

        For targets whose outlines do not follow from ``columns``.
        """
        return None

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


def widened_by(values: np.ndarray, interval: np.ndarray, deviation: Any) -> np.ndarray:
    """Widen 95 % intervals ``[2, ...]`` around values by independent normal noise.

    Exact if the particles are normally distributed around the values.
    """
    reach = np.hypot(interval - values, 1.96 * deviation)
    return np.stack([values - reach[0], values + reach[1]])


def looks_of_scene(scene: Any, num_particles: int, typical: Any = None) -> Looks:
    """A scene's reference patches and first frame, to learn a likelihood from."""
    return Looks(
        frame=None,
        patches=scene.patches,
        frame_shape=scene.frames.shape[1:3],
        num_particles=num_particles,
        typical=typical,
        surroundings=scene.frames[0],
        is_filmed=is_filmed(scene),
    )


def is_filmed(scene: Any) -> bool:
    """Whether a scene was filmed by a camera: scenes read from a folder are."""
    return "source" in scene.extras
