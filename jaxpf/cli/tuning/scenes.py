"""Open the scenes to tune on, and name those that stay unseen."""

import dataclasses
from typing import TYPE_CHECKING

from jaxpf.cli.shared.scene_options import scene_parameters
from jaxpf.contract.errors import InputError
from jaxpf.evaluation.opening import load_scene
from jaxpf.evaluation.scene import check_scene

if TYPE_CHECKING:
    from jaxpf.cli.tuning.command import Options
    from scenes import Scene


def scenes_to_tune_on(source: str, options: "Options") -> "list[Scene]":
    """Synthetic scenes with consecutive seeds, or the first frames of a folder."""
    first, *others = range(options.scene_seed, options.scene_seed + options.train_scenes)
    parameters = scene_parameters(options.set)
    scene = load_scene(source, first, options.ids, options.start_frame, None, parameters)
    check_scene(scene)
    if "source" in scene.extras:
        return [_cut(scene, options.frames)]
    if options.frames is not None:
        raise InputError(
            f"--frames {options.frames} divides a folder's frames, but {source!r} is drawn by a "
            "function; leave it out."
        )
    drawn = {first: scene}
    for seed in others:
        drawn[seed] = load_scene(source, seed, parameters=parameters)
        check_scene(drawn[seed])
    return [
        dataclasses.replace(scene, name=f"{scene.name}, seed {seed}")
        for seed, scene in drawn.items()
    ]


def _cut(scene: "Scene", count: int | None) -> "Scene":
    """The first frames of a sequence, by default half."""
    total = len(scene.frames)
    count = total // 2 if count is None else count
    if not 2 <= count <= total - 2:
        raise InputError(
            f"--frames {count} must be 2 to {total - 2}: of the {total} frames of {scene.name!r} "
            "some must be left for a comparison."
        )
    start = int(scene.extras["start_frame"])
    return dataclasses.replace(
        scene,
        frames=scene.frames[:count],
        boxes=scene.boxes[:count],
        name=f"{scene.name}, frames {start} to {start + count - 1}",
    )


def unseen(scenes: "list[Scene]", options: "Options") -> list[str]:
    """Flags of `jaxpf evaluate` for frames after a folder's, or for the next seed."""
    extras = scenes[0].extras
    if "source" in extras:
        return ["--start-frame", str(int(extras["start_frame"]) + len(scenes[0].frames))]
    parameters = [word for text in options.set for word in ("--set", text)]
    return ["--scene-seed", str(options.scene_seed + len(scenes)), *parameters]
