"""The interface of a target, so that no other module needs to know a target by name.

A target defines what a substate means, and how programs read, write and draw it.  Its module
imports JAX and OpenCV only when a tracker is built or something is drawn, so that the command line
can list its options quickly.
"""

import abc
import contextlib
import dataclasses
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from jaxpf.contract.errors import InputError
from jaxpf.contract.model import Model

if TYPE_CHECKING:
    import jax
    from jax.typing import ArrayLike

    from jaxpf.contract.types import LikelihoodLike, TrackerLike
    from jaxpf.media.frame_source import FrameSource
    from scenes import Scene


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
        remarks: warnings about input that was accepted but may be a mistake.
    """

    ids: np.ndarray
    shapes: np.ndarray
    sizes: np.ndarray
    parents: tuple[int, ...]
    reach: Any = dataclasses.field(default=0.0, kw_only=True)
    remarks: tuple[str, ...] = dataclasses.field(default=(), kw_only=True)

    @property
    def num_partitions(self) -> int:
        """P, the number of objects."""
        return len(self.parents)


class Looks(NamedTuple):
    """What a likelihood is learned from: either ``frame`` or ``patches`` is given.

    Attributes:
        frame: uint8 RGB ``[H, W, 3]``, the start frame, showing the objects at ``Start``.
        patches: P pictures, uint8 RGB ``[h, w, 3]``, upright.
        frame_shape: height and width of all frames.
        num_particles: particles of one run, for choices that depend on cost.
        typical: uint8 RGB ``[n, H, W, 3]``, typical frames, from which a background is learned.
        surroundings: uint8 RGB ``[H, W, 3]``, the start frame if ``patches`` are given.
        settings: values for options that the user leaves open, of a scene that brings some.
    """

    frame: Any
    patches: Any
    frame_shape: tuple[int, int]
    num_particles: int
    typical: np.ndarray | None = None
    surroundings: np.ndarray | None = None
    settings: Mapping[str, Any] = {}

    @property
    def start_frame(self) -> Any:
        """The start frame, showing objects and surroundings."""
        return self.surroundings if self.frame is None else self.frame


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


class Target(abc.ABC):
    """A kind of target: a substate's meaning, likelihood and motion, and its files and drawing.

    A target must define ``name``, ``options`` and all abstract methods; a class without them cannot
    be instantiated.  The rest has defaults, some of which raise ``InputError``.  A target may
    define its own dynamics and likelihood.

    Attributes:
        name: its name in the registry of ``jaxpf.targets``.
        options: class of the options of its model (``jaxpf.contract.options``).
        defaults: filter options whose defaults this target overrides.
        unsuited: methods that refuse such targets, so that help and evaluations leave them out.
        coordinates: display names of a substate's first coordinates; if the first two are x and
            y, they are a position in pixels.
        has_boxes: whether its shapes are boxes x, y, w, h, as in MOT files and standard scores.
        outlines_of_estimates: function of estimates ``[..., P, D]`` and sizes ``[P, 2]`` that
            returns outlines ``[..., P, V, 2]``, differentiable; None if shapes are boxes.
        start_flags: options of ``jaxpf track`` that say where objects start, name -> arguments of
            ``click.option``; ``read_start`` gets their values.
        example: arguments of ``jaxpf track`` after the video, for its help.
        columns: columns of tracks.csv that hold an object's position; angles in degrees, all
            others in pixels.
        place: what the interval that a verdict names is of.
        fixed_columns: those columns that never change, and so have no interval.
    """

    name: str
    options: type
    defaults: Mapping[str, Any] = {}
    unsuited: tuple[str, ...] = ()
    coordinates: tuple[str, ...] = ()
    has_boxes: bool = False
    outlines_of_estimates: "Callable[[jax.Array, jax.Array], jax.Array] | None" = None
    start_flags: Mapping[str, Mapping[str, Any]] = {}
    example: str = ""
    columns: tuple[str, ...] = ("x", "y")
    place: str = "centre"
    fixed_columns: tuple[str, ...] = ()

    @abc.abstractmethod
    def start(self, given: Any, names: Sequence[object] | None = None) -> Start:
        """Where objects start, from the argument of the target's public factory.

        Args:
            given: for example boxes ``[P, 4]``.
            names: of the objects; by default their numbers.

        Raises:
            InputError: the argument is invalid.
        """

    @abc.abstractmethod
    def likelihood(self, options: Any, start: Start, looks: Looks) -> "LikelihoodLike":
        """The likelihood of the objects' appearance.

        Args:
            options: resolved, see ``resolved``; the same in all methods below.
            start: where the objects start.
            looks: what the likelihood is learned from.

        Raises:
            InputError: an option is out of range, or an object is too small to be seen.
        """

    @abc.abstractmethod
    def model(self, options: Any, start: Start, likelihood: "LikelihoodLike") -> Model:
        """The model: dynamics and initial state, with the given (or a user's own) likelihood."""

    def training_likelihood(
        self, options: Any, start: Start, looks: Looks, frames: np.ndarray
    ) -> "LikelihoodLike":
        """A normalised likelihood, differentiable in its parameters and the state, for tuning.

        Args:
            options, start, looks: as for ``likelihood``.
            frames: ``[n, H, W, 3]``, from which a background is learned.
        """
        raise InputError(
            f"{self.name} have no differentiable model to tune; tune a tracker of your own in "
            "Python with jaxpf.tune."
        )

    def resolved(
        self, options: Any, settings: Mapping[str, Any], num_objects: int | None = None
    ) -> Any:
        """The options with "auto" values filled in, by ``Looks.settings`` first.

        With ``num_objects``, defaults that depend on it are filled in as well.
        """
        return options

    def settled(self, options: Any, start: Start, looks: Looks) -> Any:
        """The options with every "auto" replaced by its choice, to be stored with the results."""
        return self.resolved(options, looks.settings)

    @abc.abstractmethod
    def shapes(self, start: Start, estimate: "ArrayLike", tracker: "TrackerLike") -> np.ndarray:
        """Shapes ``[..., P, S]`` of a tracker's estimates ``[..., P, D]``."""

    @abc.abstractmethod
    def outlines(self, start: Start, shapes: "ArrayLike") -> "jax.Array | np.ndarray":
        """Corners ``[..., P, V, 2]`` of convex polygons, in order, in pixels."""

    @property
    def has_places(self) -> bool:
        """Whether a substate begins with x and y, a position or its shift in pixels."""
        return tuple(self.coordinates[:2]) == ("x", "y")

    def measures(self, start: Start, shapes: "ArrayLike", truth: "ArrayLike") -> dict[str, Any]:
        """Error measures per frame, see ``jaxpf.measures.outlines``."""
        from jaxpf.measures.outlines import measure_outlines

        return measure_outlines(self.outlines(start, shapes), self.outlines(start, truth))

    @abc.abstractmethod
    def read_start(self, given: Mapping[str, Any], number: int, source: "FrameSource") -> Start:
        """Read where the user's objects start.

        Args:
            given: values of ``start_flags``.
            number: index of the start frame, from 0.
            source: has ``width``, ``height`` and ``path``.

        Raises:
            InputError: no option was given, a file is unreadable, or an object is off the frame.
        """

    def later_starts(
        self, given: Mapping[str, Any], number: int, source: "FrameSource"
    ) -> tuple[dict[int, Start], str | None]:
        """Objects that start, or start again, after the start frame ``number``.

        Returns:
            frame -> start, and a remark for the user or None.
        """
        return {}, None

    @abc.abstractmethod
    def fits_scene(self, scene: "Scene") -> bool:
        """Whether a scene's ground truth is of this kind."""

    @abc.abstractmethod
    def scene_shapes(self, scene: "Scene") -> np.ndarray:
        """A scene's ground truth ``[T, P, S]``, NaN where an object is absent."""

    @abc.abstractmethod
    def scene_start(self, scene: "Scene") -> Start:
        """Where the objects are in a scene's first frame."""

    def column_values(self, start: Start, shapes: np.ndarray) -> np.ndarray:
        """Values ``[..., P, C]`` of ``columns`` for shapes ``[..., P, S]``."""
        return shapes[..., :2]

    def outline_file(
        self, path: Path, start: Start
    ) -> contextlib.AbstractContextManager[Callable[[int, np.ndarray], None] | None]:
        """Open a new outlines.csv; as a context it is a function of a frame's number and shapes.

        By default there is no such file, and the context is None.
        """
        return contextlib.nullcontext()

    @abc.abstractmethod
    def draw(self, frame: np.ndarray, start: Start, shapes: np.ndarray, marks: Marks) -> np.ndarray:
        """The frame with the shapes drawn on it.

        Args:
            frame: uint8 RGB ``[H, W, 3]``.
            start: where tracking started.
            shapes: ``[P, S]``.
            marks: how each is drawn.
        """

    def draw_particles(
        self,
        frame: np.ndarray,
        start: Start,
        tracker: "TrackerLike",
        state: Any,
        colours: np.ndarray,
    ) -> np.ndarray:
        """The frame with a tracker's particles drawn on it, by default one dot each."""
        from jaxpf.media.overlay import draw_particles

        if not hasattr(state, "substates"):
            return frame
        centres = np.swapaxes(np.asarray(state.substates)[..., :2], 0, 1)
        return draw_particles(frame, centres, colours)
