"""Stored settings of an evaluation: its scene and configurations, checked on resuming."""

import dataclasses
import inspect
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jaxpf.contract.errors import InputError
from jaxpf.contract.options import OPEN, applying
from jaxpf.evaluation.configurations import complete, configurations
from jaxpf.evaluation.fingerprint import describe_plan, fingerprint
from jaxpf.evaluation.plan import Plan
from jaxpf.evaluation.results import IMPORTED, OWN, Configuration
from jaxpf.evaluation.scene import object_ids, scene_digest, start_frame
from jaxpf.evaluation.schedule import double_precision
from jaxpf.evaluation.trackers import looks_of, own_tracker
from jaxpf.files.versions import versions
from jaxpf.targets.target import Start, Target

if TYPE_CHECKING:
    from scenes import Scene


def new_settings(plan: Plan, scene: "Scene", of: Target, start: Start) -> dict[str, Any]:
    """Make the content of ``settings.json``.

    Raises:
        InputError: see ``configurations``; a user-defined tracker cannot be made.
    """
    plan = complete(plan, of.name, start.parents)

    def settle(of: Target, values: dict[str, Any], num_particles: int) -> dict[str, Any]:
        # Independent of the number of runs, because these options determine the results.
        looks = looks_of(scene, num_particles)
        values = of.settle(values, looks.settings)
        if applying(of.tracker, values).get("likelihood") == OPEN:
            made = inspect.unwrap(of.tracker)(looks, start, **values)
            values["likelihood"] = made.likelihood.method
        return values

    listed = configurations(plan, start, settle)
    for name, function in plan.trackers.items():
        fixed = isinstance(own_tracker(name, function, scene), np.ndarray)
        listed.append(Configuration(name, kind=IMPORTED if fixed else OWN))
    listed += [Configuration(name, kind=IMPORTED) for name in plan.tracks]
    return {
        "versions": versions(),
        "asked": describe_plan(plan),
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
        "configurations": [dataclasses.asdict(each) for each in listed],
    }


def check_continues(settings: dict[str, Any], scene: "Scene", folder: Path) -> None:
    """Check that the scene and the precision match the finished batches.

    Raises:
        InputError: the scene or the precision differs.
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
