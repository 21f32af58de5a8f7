"""Divide scenes into frames for tuning and held-out frames."""

import dataclasses
from typing import Any

from jaxpf.cli.shared.scene_options import scene_parameters
from jaxpf.contract.errors import InputError


def divided_scenes(source: str, options: Any) -> tuple[list[Any], list[Any]]:
    """Scenes for tuning, and scenes for the comparison."""
    from jaxpf.evaluation.opening import load_scene
    from jaxpf.evaluation.work.scene import check_scene

    parameters = scene_parameters(options.set)
    first = load_scene(
        source,
        options.scene_seed,
        options.ids,
        options.start_frame,
        None,
        parameters,
    )
    if "source" not in first.extras:
        if options.frames is not None:
            raise InputError(
                f"--frames {options.frames} divides a folder's frames, but "
                f"{source!r} is drawn by a function; leave it out."
            )
        count = options.train_scenes + options.held_out
        all_ = [first] + [
            load_scene(source, options.scene_seed + i, parameters=parameters)
            for i in range(1, count)
        ]
        for i, scene in enumerate(all_):
            check_scene(scene)
            all_[i] = dataclasses.replace(
                scene, name=f"{scene.name}, seed {options.scene_seed + i}"
            )
        return all_[: options.train_scenes], all_[options.train_scenes :]
    check_scene(first)
    train, unseen = _divide(first, options.frames)
    return [train], [unseen]


def _divide(scene: Any, count: int | None) -> tuple[Any, Any]:
    """Split a sequence into its first frames and the rest, with the objects in view there."""
    import numpy as np

    from scenes.clips import cut_patch

    total = len(scene.frames)
    count = total // 2 if count is None else count
    if not 2 <= count <= total - 2:
        raise InputError(
            f"--frames {count} must be 2 to {total - 2}: of the {total} frames of {scene.name!r} "
            "some must be left for the comparison."
        )
    train = dataclasses.replace(
        scene,
        frames=scene.frames[:count],
        boxes=scene.boxes[:count],
        name=f"{scene.name}, frames {_span(scene, 0, count)}",
    )
    boxes, frames = scene.boxes[count:], scene.frames[count:]
    height, width = frames.shape[1:3]
    x, y, w, h = np.nan_to_num(boxes[0], nan=-1.0).T
    in_view = (w > 0) & (h > 0) & (x + w > 1) & (y + h > 1) & (x < width - 1) & (y < height - 1)
    kept = np.flatnonzero(in_view)
    if not len(kept):
        raise InputError(
            f"--frames {count} leaves no object in view in the frame after them, where the "
            f"comparison on {scene.name!r} starts; choose another number."
        )
    extras = dict(scene.extras)
    extras["ids"] = np.asarray(scene.extras["ids"])[kept]
    extras["start_frame"] = int(scene.extras["start_frame"]) + count
    unseen = dataclasses.replace(
        scene,
        frames=frames,
        boxes=boxes[:, kept],
        patches=[cut_patch(frames[0], boxes[0, p]) for p in kept],
        extras=extras,
        name=f"{scene.name}, frames {_span(scene, count, total)}",
    )
    return train, unseen


def _span(scene: Any, first: int, stop: int) -> str:
    start = int(scene.extras["start_frame"])
    return f"{start + first} to {start + stop - 1}"
