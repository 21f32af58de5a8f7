"""What a target says of itself, so that everything above needs no target by name.

A target is what a substate means.  Its module imports no JAX until a tracker is built, so that
the command line can show its options in a moment.
"""

import abc
import dataclasses
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from jaxpf.contract.errors import InputError
from jaxpf.contract.model import Model


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
        typical: uint8 RGB ``[n, H, W, 3]``, frames of the kind that is tracked, from which a
            background is learned.
        surroundings: uint8 RGB ``[H, W, 3]``, the start frame, where patches tell how objects look.
        is_filmed: whether frames come from a camera, and not from a synthetic scene.
    """

    frame: Any
    patches: Any
    frame_shape: tuple[int, int]
    num_particles: int
    typical: Any = None
    surroundings: Any = None
    is_filmed: bool = True

    @property
    def start_frame(self) -> Any:
        """The start frame, objects and surroundings."""
        return self.surroundings if self.frame is None else self.frame


class Target(abc.ABC):
    """What a substate means.

    What a target must define: ``name``, ``options``, ``start``, ``likelihood``, ``model``,
    ``shapes`` and ``outlines``; one that lacks a method cannot be made.  The rest has defaults,
    some of which refuse with a sentence.  Its dynamics and its likelihood may stand in its own
    file, as a user's own do.

    Attributes:
        name: by which the registry in ``jaxpf.targets`` knows it.
        options: class of the options of its model (``jaxpf.contract.options``).
        defaults: of a filter's options, where the target's differ.
        coordinates: names of a substate's first coordinates, as people read them; where the first
            two are x and y, they are a place in pixels.
        has_boxes: whether its shapes are boxes x, y, w, h, as in MOT files and standard scores.
        outlines_of_estimates: function of estimates ``[..., P, D]`` and sizes ``[P, 2]`` that gives
            outlines ``[..., P, V, 2]``, differentiable; None where shapes are boxes.
    """

    name: str
    options: type
    defaults: Mapping[str, Any] = {}
    coordinates: tuple[str, ...] = ()
    has_boxes: bool = False
    outlines_of_estimates: Callable[[Any, Any], Any] | None = None

    @abc.abstractmethod
    def start(self, given: Any, names: Any = None) -> Start:
        """Where objects start, from what the target's public factory takes.

        Args:
            given: such as boxes ``[P, 4]``.
            names: of the objects; by default their numbers.

        Raises:
            InputError: it is no such thing.
        """

    @abc.abstractmethod
    def likelihood(self, options: Any, start: Start, looks: Looks) -> Any:
        """How its looks explain a frame.

        Args:
            options: with nothing left open, see ``resolved``; like the next for all methods.
            start: where it starts.
            looks: from what it is learned.

        Raises:
            InputError: an option out of range, or an object too small to be seen.
        """

    @abc.abstractmethod
    def model(self, options: Any, start: Start, likelihood: Any) -> Model:
        """Its motion and its start, with that likelihood or one of a user's own."""

    def training_likelihood(self, options: Any, start: Start, looks: Looks, frames: Any) -> Any:
        """A likelihood that is differentiable in its parameters and in the state, and normalised,
        so that the evidence may choose among parameters.

        Args:
            options, start, looks: as for ``likelihood``.
            frames: ``[n, H, W, 3]``, from which a background is learned.
        """
        raise InputError(
            f"{self.name} have no differentiable model to tune; tune a tracker of your own in "
            "Python with jaxpf.tune."
        )

    def resolved(self, options: Any, is_filmed: bool) -> Any:
        """The options with what depends on where pictures come from, see ``Looks``."""
        return options

    @property
    def fits_motion(self) -> bool:
        """Whether it has motions to choose among."""
        return type(self).motion_candidates is not Target.motion_candidates

    def motion_candidates(self, options: Any) -> list[Any]:
        """Options that differ in the motion alone, among which the evidence of the first frames
        may choose.

        Raises:
            InputError: it has none to choose among.
        """
        raise InputError(f"{self.name} have no motion to fit.")

    def settled(self, options: Any, start: Start, looks: Looks) -> Any:
        """The options with what "auto" stands for; it decides about results, so it is kept."""
        return options

    def noise(self, options: Any, start: Start) -> np.ndarray:
        """``[3]``: process noise of the first coordinates, NaN where it has no single value."""
        return np.full(3, np.nan)

    @abc.abstractmethod
    def shapes(self, start: Start, estimate: Any, tracker: Any) -> np.ndarray:
        """Shapes ``[..., P, S]`` of a tracker's estimates ``[..., P, D]``."""

    @abc.abstractmethod
    def outlines(self, start: Start, shapes: Any) -> Any:
        """Corners ``[..., P, V, 2]`` of convex polygons, in order, pixels."""

    @property
    def has_places(self) -> bool:
        """Whether a substate begins with x and y of a place in pixels, or with its shift."""
        return tuple(self.coordinates[:2]) == ("x", "y")

    def measures(self, start: Start, shapes: Any, truth: Any) -> dict[str, Any]:
        """Measures of every frame, see ``jaxpf.measures.outlines``."""
        from jaxpf.measures.outlines import measure_outlines

        return measure_outlines(self.outlines(start, shapes), self.outlines(start, truth))
