"""What a target says of itself, so that everything above needs no target by name.

A target is what a substate means.  Its module imports no JAX until a tracker is built, so that
the command line can show its options in a moment.
"""

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from jaxpf.errors import InputError
from jaxpf.models.model import Model


@dataclasses.dataclass(frozen=True, eq=False)
class Start:
    """Where P objects are in the frame from which tracking starts.

    A *shape* is what a target reports of an object in a frame, S numbers: a box, a pose.

    Attributes:
        ids: ``[P]``, numbers or names by which people know the objects.
        shapes: float64 ``[P, S]``.
        sizes: float64 ``[P, 2]``, width and height in pixels of the objects as they start.
        parents: the part tree, -1 for a root.
        remarks: sentences on what was accepted but may be a mistake.
    """

    ids: np.ndarray
    shapes: np.ndarray
    sizes: np.ndarray
    parents: tuple[int, ...]
    remarks: tuple[str, ...] = dataclasses.field(default=(), kw_only=True)

    @property
    def num_partitions(self) -> int:
        """P."""
        return len(self.parents)


class Looks(NamedTuple):
    """From what likelihoods are learned; either the first or the second is given.

    Attributes:
        frame: uint8 RGB ``[H, W, 3]``, the start frame, with the objects where ``Start`` says.
        patches: P pictures, uint8 RGB ``[h, w, 3]``, upright.
        frame_shape: height and width of all frames.
        num_particles: of one run, where cost decides what is chosen.
        num_runs: runs that share a frame's work, likewise.
        typical: uint8 RGB ``[n, H, W, 3]``, frames of the kind that is tracked, from which a
            background is learned.
        surroundings: uint8 RGB ``[H, W, 3]``, the start frame, where patches tell how objects look.
        is_filmed: whether frames come from a camera, and not from a synthetic scene.
    """

    frame: Any
    patches: Any
    frame_shape: tuple[int, int]
    num_particles: int
    num_runs: int = 1
    typical: Any = None
    surroundings: Any = None
    is_filmed: bool = True

    @property
    def start_frame(self) -> Any:
        """The start frame, objects and surroundings."""
        return self.surroundings if self.frame is None else self.frame


def looks_of_scene(scene: Any, num_particles: int, num_runs: int = 1, typical: Any = None) -> Looks:
    """A scene's reference patches, and its first frame; clips from folders were filmed."""
    return Looks(
        frame=None,
        patches=scene.patches,
        frame_shape=scene.frames.shape[1:3],
        num_particles=num_particles,
        num_runs=num_runs,
        typical=typical,
        surroundings=scene.frames[0],
        is_filmed=is_filmed(scene),
    )


def is_filmed(scene: Any) -> bool:
    """Whether a scene comes from a folder, and so from a camera."""
    return "source" in scene.extras


class Marks(NamedTuple):
    """How P shapes are drawn on a frame; a target takes what it can show.

    Attributes:
        colours: uint8 RGB ``[P, 3]``.
        lost: bool ``[P]``.
        past: ``[L, P, S]``, shapes of the frames before, the latest last, for trails.
        doubtful: bool ``[P]``, probably lost; None where nobody can tell.
    """

    colours: Any
    lost: Any
    past: Any = None
    doubtful: Any = None


class Target:
    """What a substate means.

    Attributes:
        name: by which the registry in ``jaxpf.targets`` knows it.
        noun: what one of them is called.
        options: class of the options of its model (``jaxpf.options``).
        start_flags: option of ``jaxpf track`` -> (arguments of ``click.option``), which say where
            it starts; ``read_start`` is given their values.
        defaults: of a filter's options, where the target's differ.
        open_defaults: of its own options, where objects come and go by detections.
        has_boxes: whether its shapes are boxes x, y, w, h, as in MOT files and standard scores.
        outlines_of_estimates: function of estimates ``[..., P, D]`` and sizes ``[P, 2]`` that gives
            outlines ``[..., P, V, 2]``, differentiable; None where shapes are boxes.
        track_suffix: of the files that ``track_writer`` writes.
    """

    name: str
    noun: str
    options: type
    start_flags: Mapping[str, Mapping[str, Any]] = {}
    defaults: Mapping[str, Any] = {}
    open_defaults: Mapping[str, Any] = {}
    has_boxes: bool = False
    track_suffix: str = ".csv"
    outlines_of_estimates: Callable[[Any, Any], Any] | None = None

    # Where it starts.

    def read_start(self, given: Mapping[str, Any], number: int, source: Any) -> Start:
        """Where a user says that it starts.

        Args:
            given: values of ``start_flags``.
            number: the start frame, from 0.
            source: has ``width``, ``height`` and ``path``.

        Raises:
            InputError: nothing was said, a file cannot be read, or an object is not in the frame.
        """
        raise TypeError(f"{type(self).__name__} must define read_start")

    def fits_scene(self, scene: Any) -> bool:
        """Whether a scene's truth is of this kind."""
        raise TypeError(f"{type(self).__name__} must define fits_scene")

    def scene_shapes(self, scene: Any) -> np.ndarray:
        """A scene's truth ``[T, P, S]``, NaN where an object is absent."""
        raise TypeError(f"{type(self).__name__} must define scene_shapes")

    def scene_start(self, scene: Any) -> Start:
        """Where the objects are in a scene's first frame."""
        raise TypeError(f"{type(self).__name__} must define scene_start")

    # Its model.

    def model(self, options: Any, start: Start, looks: Looks) -> Model:
        """The model that follows from where it starts and how it looks.

        Raises:
            InputError: an option out of range, or an object too small to be seen.
        """
        raise TypeError(f"{type(self).__name__} must define model")

    def open_model(
        self, options: Any, capacity: int, typical_size: tuple[float, float], looks: Looks
    ) -> Model:
        """The model of as many objects as there may be at once, of whom none is there yet.

        Args:
            options: as for ``model``.
            capacity: P.
            typical_size: width and height of an object, pixels.
            looks: its ``frame_shape`` and number of particles count.
        """
        raise InputError(f"{self.name} cannot come and go; leave --births out.")

    def training_model(self, options: Any, start: Start, looks: Looks, frames: Any) -> Model:
        """A model that is differentiable in its parameters and in the state, and whose evidence
        may choose among them: a normalised likelihood.

        Args:
            options: as for ``model``, like the next two.
            start: see there.
            looks: see there.
            frames: ``[n, H, W, 3]``, from which a background is learned.
        """
        raise InputError(
            f"{self.name} have no differentiable model to tune; tune a tracker of your own in "
            "Python with jaxpf.tune."
        )

    def resolved(self, options: Any, is_filmed: bool) -> Any:
        """The options with what depends on where pictures come from, see ``Looks``."""
        return options

    def motion_candidates(self, options: Any) -> list[Any]:
        """Options that differ in the motion alone, among which the evidence of the first frames
        may choose.

        Raises:
            InputError: it has none to choose among.
        """
        raise InputError(f"{self.name} have no motion to fit; leave --fit-motion out.")

    def with_motion(self, model: Model, options: Any, start: Start) -> Model:
        """A model of one candidate with the motion of another: what it learned it keeps."""
        raise TypeError(f"{type(self).__name__} must define with_motion")

    def tuned_by_default(self, options: Any) -> tuple[str, ...]:
        """Tracker paths of what is tuned where nobody says what."""
        return ()

    def settled(self, options: Any, start: Start, looks: Looks) -> Any:
        """The options with what "auto" stands for; it decides about results, so it is kept."""
        return options

    def noise(self, options: Any, start: Start) -> np.ndarray:
        """``[3]``: process noise of the first coordinates, NaN where it has no single value."""
        return np.full(3, np.nan)

    def tuned(self, options: Any, values: Mapping[str, Any]) -> Any:
        """The options with tuned values, tracker path -> value.

        Raises:
            InputError: a path that no option stands for.
        """
        raise TypeError(f"{type(self).__name__} must define tuned")

    def positions(self, start: Start, shapes: Any) -> Any:
        """Centres ``[..., P, >= 2]`` of shapes, pixels; NaN where an object is absent."""
        raise TypeError(f"{type(self).__name__} must define positions")

    # What it reports.

    def shapes(self, start: Start, estimate: Any) -> np.ndarray:
        """Shapes ``[..., P, S]`` of estimates ``[..., P, D]``."""
        raise TypeError(f"{type(self).__name__} must define shapes")

    def shapes_of(self, tracker: Any, start: Start, estimate: Any) -> np.ndarray:
        """Shapes ``[..., P, S]`` of a tracker's estimates, where its model tells more than they."""
        return self.shapes(start, estimate)

    def outlines(self, start: Start, shapes: Any) -> Any:
        """Corners ``[..., P, V, 2]`` of convex polygons, in order, pixels."""
        raise TypeError(f"{type(self).__name__} must define outlines")

    def scaled(
        self, start: Start, shapes: np.ndarray, factors: tuple[float, float]
    ) -> tuple[Start, np.ndarray]:
        """Where shapes lie in a picture that is so much wider and higher."""
        raise TypeError(f"{type(self).__name__} must define scaled")

    def measures(self, start: Start, shapes: Any, truth: Any) -> dict[str, Any]:
        """Measures of every frame, see ``jaxpf.measures.outlines``."""
        from jaxpf.measures.outlines import measure_outlines

        return measure_outlines(self.outlines(start, shapes), self.outlines(start, truth))

    def track_writer(self, path: Any, start: Start) -> Any:
        """A writer with ``append(frame, shapes, lost)``, which closes as a context does.

        Where objects come and go, ``append`` also takes ``ids``; where a likelihood can tell,
        ``confidence`` ``[P]``.
        """
        raise TypeError(f"{type(self).__name__} must define track_writer")

    def draw(self, frame: Any, start: Start, shapes: Any, marks: Marks) -> np.ndarray:
        """The frame with the shapes drawn on it.

        Args:
            frame: uint8 RGB ``[H, W, 3]``.
            start: where tracking started.
            shapes: ``[P, S]``.
            marks: how each is drawn.
        """
        raise TypeError(f"{type(self).__name__} must define draw")

    def draw_particles(
        self, frame: Any, start: Start, tracker: Any, state: Any, colours: Any
    ) -> np.ndarray:
        """The frame with a tracker's particles drawn on it: by default a dot for each."""
        from jaxpf.media.overlay import draw_particles

        if not hasattr(state, "substates"):
            return frame
        centres = np.swapaxes(np.asarray(state.substates)[..., :2], 0, 1)
        return draw_particles(frame, centres, colours)
