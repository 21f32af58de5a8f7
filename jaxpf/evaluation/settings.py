"""What is kept of an evaluation's scene and configurations, and what a scene must have."""

from typing import Any

import numpy as np

from jaxpf.errors import InputError
from jaxpf.evaluation.fingerprint import fingerprint
from jaxpf.evaluation.plan import Plan
from jaxpf.evaluation.results import IMPORTED, OWN, Configuration
from jaxpf.evaluation.schedule import double_precision
from jaxpf.evaluation.trackers import looks_of, own_tracker
from jaxpf.evaluation.worker import scene_digest
from jaxpf.files.versions import versions
from jaxpf.targets import find_target, target_of_scene
from jaxpf.targets.target import Start, Target


def check_scene(scene: Any) -> None:
    """Refuse a scene in which trackers cannot start.

    Raises:
        InputError: an object without a box in the first frame; no second frame.
    """
    first = np.asarray(scene.boxes[0], float)
    proper = np.isfinite(first).all(axis=1) & (first[:, 2:] > 0).all(axis=1)
    for index in np.flatnonzero(~proper):
        raise InputError(
            f"scene {scene.name!r}: object {object_ids(scene)[index]} has no box in the start "
            f"frame ({start_frame(scene)}); leave it out with `ids`, or choose another start frame."
        )
    if len(scene.frames) < 2:
        raise InputError(
            f"scene {scene.name!r} has {len(scene.frames)} frame(s): trackers start in the first, "
            "so give at least 2."
        )


def target_for(name: str | None, scene: Any) -> Target:
    """The target of that name, or else that of a scene's truth.

    Raises:
        InputError: there is none, or the scene's truth is of another kind.
    """
    if name is None:
        return target_of_scene(scene)
    of = find_target(name)
    if not of.fits_scene(scene):
        raise InputError(
            f"scene {scene.name!r} has no truth for {of.name}; leave the target out, which takes "
            f"{target_of_scene(scene).name}."
        )
    return of


def object_ids(scene: Any) -> list[int]:
    """The truth's numbers of the objects; from 1 where a scene has none."""
    return [int(number) for number in scene.extras.get("ids", range(1, scene.boxes.shape[1] + 1))]


def start_frame(scene: Any) -> int:
    """The frame of the source in which a scene begins."""
    return int(scene.extras.get("start_frame", 0))


def new_settings(plan: Plan, scene: Any, of: Target, start: Start) -> dict[str, Any]:
    """What ``settings.json`` holds.

    Raises:
        InputError: see ``Plan.configurations``; a user's tracker that cannot be made.
    """
    plan = plan.for_target(of.name, start.parents)

    def settle(of: Target, options: Any, particles: int) -> Any:
        # Whatever the number of runs: it decides about results.
        return of.settled(options, start, looks_of(scene, particles))

    configurations = plan.configurations(start, settle)
    for name, function in plan.trackers.items():
        fixed = isinstance(own_tracker(name, function, scene), np.ndarray)
        configurations.append(Configuration(name, kind=IMPORTED if fixed else OWN))
    configurations += [Configuration(name, kind=IMPORTED) for name in plan.tracks]
    return {
        "versions": versions(),
        "asked": plan.asked(),
        "runs": plan.runs,
        "float64": double_precision(),
        "scene": {
            "name": scene.name,
            "target": of.name,
            "parents": list(start.parents),
            "object_ids": object_ids(scene),
            "start_frame": start_frame(scene),
            "fps": float(scene.fps),
            "num_frames": len(scene.frames),
            "width": scene.frames.shape[2],
            "height": scene.frames.shape[1],
            "digest": scene_digest(scene),
            "files": fingerprint(plan.scene),
        },
        "configurations": [
            {
                "method": c.method,
                "ordering": c.ordering,
                "parameters": c.parameters,
                "variant": c.variant,
                "kind": c.kind,
            }
            for c in configurations
        ],
    }


def check_continues(settings: dict[str, Any], scene: Any, folder: Any) -> None:
    """Refuse to mix results of different pictures or precisions.

    Raises:
        InputError: the scene or the precision is not that of the finished batches.
    """
    if scene_digest(scene) != settings["scene"]["digest"]:
        raise InputError(
            f"scene {scene.name!r} has other pictures or boxes than when the evaluation in "
            f"'{folder}' was begun; choose another output folder, or restore the scene."
        )
    if double_precision() != settings["float64"]:
        begun, now = ("double", "single") if settings["float64"] else ("single", "double")
        raise InputError(
            f"the evaluation in '{folder}' was begun in {begun} precision, now {now}; choose "
            "another output folder, or set JAX_ENABLE_X64 as it was."
        )
