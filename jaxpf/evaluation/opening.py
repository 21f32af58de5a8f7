"""Opens scenes for evaluations: the only module that imports both packages."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import scenes
from jaxpf.contract.errors import Argument, InputError
from jaxpf.contract.options import plain


def load_scene(
    source: str,
    seed: int = 0,
    ids: Sequence[int] | None = None,
    start_frame: int | None = None,
    num_frames: int | None = None,
    parameters: Mapping[str, Any] | None = None,
) -> scenes.Scene:
    """Picklable ``scenes.open_scene``, for ``functools.partial`` and worker processes.

    Raises:
        InputError: the scene cannot be opened; the message is that of ``scenes``.
    """
    try:
        scene = scenes.open_scene(
            source,
            seed=seed,
            ids=ids,
            start_frame=start_frame,
            num_frames=num_frames,
            parameters=parameters,
        )
    except scenes.SceneError as error:
        raise as_input_error(error) from error
    if isinstance(scene.frames, scenes.LazyFrames):
        # Lazy frames may still fail when they are read.
        scene = dataclasses.replace(scene, frames=scene.frames.with_fault(as_input_error))
    return scene


def as_input_error(error: scenes.SceneError) -> InputError:
    """Convert a ``SceneError`` to an ``InputError`` with the same message."""
    text = error.text if error.text.endswith(".") else f"{error.text}."
    if error.argument is None:
        return InputError(text)
    name, value = error.argument
    return InputError(Argument(name, repr(value), typed=plain(value)), f" {text}")
