"""Prepare scenes for tuning, and translate between parameters of trackers and options."""

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any

import jax
import numpy as np
from jax.typing import ArrayLike

from jaxpf.contract.errors import Argument, InputError, choice
from jaxpf.contract.options import Option, applying, complete, options_of
from jaxpf.gradients import GRADIENTS
from jaxpf.targets import building
from jaxpf.targets.registry import find_target
from jaxpf.targets.target import Looks, Start, Target
from jaxpf.tuning.problem import TrainingSequence
from scenes import Scene

#: Number of frames from which the background is learned.
_BACKGROUND_FRAMES = 3


@dataclasses.dataclass(frozen=True)
class Recipe:
    """The options from which a tracker is built, including tuned values.

    Attributes:
        target: name of a target, see ``jaxpf.targets``.
        values: options of the target and of the method's filter, including ``method``; the rest
            have their defaults.
        gradient: name of a gradient through resampling, see ``jaxpf.gradients.GRADIENTS``.
    """

    target: str
    values: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    gradient: str = "stop_gradient"

    def __post_init__(self) -> None:
        of = self.of
        values = {**of.defaults, **self.values}
        filter_ = building.filter_for(of, values.get("method"))
        building.check_names(self.values, of, filter_)
        # Not given but defaults, because values may stand beside others that exclude them.
        values = complete({}, filter_.build, of.tracker, defaults=values)
        object.__setattr__(self, "values", values)

    @property
    def of(self) -> Target:
        """The target."""
        return find_target(self.target)

    def with_values(self, values: Mapping[str, Any]) -> "Recipe":
        """Replace values by tuned ones, tracker path -> value."""
        return dataclasses.replace(self, values=with_tuned(self.of, self.values, values))

    def tracker(self, start: Start, looks: Looks) -> Any:
        """The tracker of ``jaxpf evaluate``, made differentiable by ``looks.background``."""
        if not self.of.can_be_tuned:
            raise InputError(
                f"{self.target} have no differentiable model to tune; tune a tracker of your own "
                "in Python with jaxpf.tune."
            )
        return building.build(self.of, {**self.values}, start, looks)


def training_sequence(
    scene: Scene, recipe: Recipe, objective: str | Callable, labels: int | None = None
) -> TrainingSequence:
    """Build a sequence with a tracker that is differentiable in parameters and state.

    Its likelihood is divided by the likelihood of objects anywhere in a few frames.  This leaves
    the weights unchanged: tuned values suit any other tracker of the target.

    Args:
        scene: see ``scenes.Scene``; trackers start in its first frame.
        recipe: holds the starting values.
        objective: see ``tune``.
        labels: number of frames that keep their ground truth, evenly spread and including the last
            one; default all.
    """
    of = recipe.of
    start = of.scene_start(scene)
    background = scene.frames[_spread(len(scene.frames), _BACKGROUND_FRAMES)]
    particles = recipe.values["num_particles"]
    looks = building.looks_of_scene(scene, particles, background=background)
    tracker = recipe.tracker(start, looks)
    if not hasattr(tracker, "gradient"):
        raise InputError(
            choice("method", recipe.values["method"]),
            " has no gradient; tune with another, such as dps, as tuned values suit any method.",
        )
    tracker = dataclasses.replace(tracker, gradient=GRADIENTS[recipe.gradient])
    shapes = np.array(of.scene_shapes(scene)[1:], np.float32)
    if labels is not None:
        if not 1 <= labels <= len(shapes):
            raise InputError(
                Argument("labels", labels),
                f" must be 1 to {len(shapes)}, the frames of {scene.name!r} after its first.",
            )
        kept = len(shapes) - 1 - _spread(len(shapes), labels)
        shapes[np.setdiff1d(np.arange(len(shapes)), kept)] = np.nan
    of_places = objective in ("position", "crps")
    truth = np.asarray(of.outlines(shapes, start.sizes)).mean(axis=-2) if of_places else shapes
    return TrainingSequence(
        tracker=tracker,
        frames=_at_hand(scene.frames[1:]),
        truth=None if objective == "evidence" else truth,
        sizes=start.sizes.astype(np.float32),
        name=scene.name,
        outlines=None if of.has_boxes else of.outlines,
    )


def _at_hand(frames: Any) -> Any:
    """Load all frames onto the device, since a gradient needs all of them."""
    return frames if isinstance(frames, np.ndarray) else jax.device_put(np.asarray(frames))


def _spread(count: int, wanted: int) -> np.ndarray:
    """At most ``wanted`` of the numbers below ``count``, evenly spread, including 0."""
    return np.unique(np.rint(np.linspace(0, count - 1, min(wanted, count))).astype(int))


def tuned_by_default(owner: Callable[..., Any], values: Mapping[str, Any]) -> tuple[str, ...]:
    """Paths of the parameters that are tuned by default, of a factory with these options."""
    applies = applying(values, owner)
    return tuple(
        option.path + ending
        for name, option in options_of(owner).items()
        if name in applies
        for ending in option.tuned
    )


def with_tuned(
    target: Target, options: Mapping[str, Any], values: Mapping[str, ArrayLike]
) -> dict[str, Any]:
    """Replace a target's options by tuned values, tracker path -> value.

    A path is such as ``dynamics.scale[0]``, or ``dynamics.scale`` for all numbers of the option.
    """
    changed = dict(options)
    declared = options_of(target.tracker).values()
    by_path = {option.path: option for option in declared if option.path}
    for path, value in values.items():
        name, _, index = path.partition("[")
        option = by_path.get(name)
        if option is None:
            raise InputError(
                f"a model of {target.name} has no {path}; apply the result to a tracker."
            )
        if not option.applies(changed):
            changed[option.needs[0]] = option.needs[1]
        before = changed[option.name]
        changed[option.name] = option.checked(_value(option, before, index.rstrip("]"), value))
    return changed


def _value(option: Option, before: Any, index: str, value: Any) -> Any:
    """A tracker value in the option's units; the option's other numbers are unchanged."""
    if not option.length:
        return option.kind(value)
    numbers = list(before)
    given = {int(index): value} if index else dict(enumerate(value))
    for place, number in given.items():
        numbers[place] = float(number) / (option.factors[place] if option.factors else 1.0)
    return tuple(numbers)
