"""Makes trackers for scenes, built in or user-defined.

A user-defined tracker is a function of the scene, called once per scene and process.  It returns
a tracker (``jaxpf.contract.Tracker``), or boxes ``[T, P, 4]`` of all frames including the start
frame, which count as one deterministic run.  A tracker's estimates are interpreted by the scene's
target (for boxes: u, v, scale) unless the tracker has a method
``boxes(estimate [..., P, D]) -> [..., P, 4]``.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from jaxpf.contract.errors import InputError
from jaxpf.evaluation.results import BUILT_IN, Configuration
from jaxpf.targets import building
from jaxpf.targets.target import Looks, Target

if TYPE_CHECKING:
    from scenes import Scene

#: One frame in this many samples the appearance of a scene.
_EVERY = 8


def looks_of(scene: "Scene", num_particles: int | None) -> Looks:
    """Appearance of a scene's objects."""
    return building.looks_of_scene(scene, num_particles, typical=scene.frames[::_EVERY])


def built_in_tracker(scene: "Scene", target: Target, configuration: Configuration) -> Any:
    """Build the tracker of one configuration: its filter on the scene's target."""
    values = configuration.parameters | configuration.variant
    looks = looks_of(scene, values.get("num_particles"))
    return building.build(target, values, target.scene_start(scene), looks)


def own_tracker(name: str, function: Any, scene: Any) -> Any:
    """Call a user's function on a scene; returns a tracker, boxes ``[T, P, 4]`` or points.

    Raises:
        InputError: the function fails or returns something else.
    """
    try:
        tracker = function(scene)
    except InputError:
        raise
    except Exception as error:
        cause = " ".join(f"{type(error).__name__}: {error}".split())
        raise InputError(f"the tracker {name!r} cannot be made: {cause}.") from error
    if hasattr(tracker, "init") and hasattr(tracker, "step"):
        return tracker
    if hasattr(tracker, "__array__"):
        try:
            boxes = np.asarray(tracker, np.float64)
        except (ValueError, TypeError):
            raise InputError(
                f"the tracker {name!r} returned boxes that are no numbers; return [T, P, 4]."
            ) from None
        if boxes.shape not in (scene.boxes.shape, np.shape(scene.extras.get("points"))):
            raise InputError(
                f"the tracker {name!r} returned boxes of shape {list(boxes.shape)}; the scene has "
                f"{list(scene.boxes.shape)}: all frames, the start frame included."
            )
        return boxes
    raise InputError(
        f"the tracker {name!r} is {type(tracker).__name__}; return a tracker with init and step, "
        "or boxes [T, P, 4]."
    )


def tracker_of(
    scene: "Scene",
    target: Target,
    configuration: Configuration,
    function: Callable[[Any], Any] | None = None,
) -> Any:
    """Make the tracker of a configuration, built in or from a user's function."""
    if configuration.kind == BUILT_IN:
        return built_in_tracker(scene, target, configuration)
    return own_tracker(configuration.method, function, scene)
