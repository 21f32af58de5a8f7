"""Opening scenes for evaluations: the one place where both are known."""

from collections.abc import Mapping, Sequence
from typing import Any

import scenes
from jaxpf.errors import InputError


def load_scene(
    source: str,
    seed: int = 0,
    ids: Sequence[int] | None = None,
    start_frame: int | None = None,
    num_frames: int | None = None,
    parameters: Mapping[str, Any] | None = None,
) -> scenes.Scene:
    """``scenes.open_scene``, for ``functools.partial`` and worker processes.

    Raises:
        InputError: the scene cannot be opened; the sentence is that of ``scenes``.
    """
    try:
        return scenes.open_scene(
            source,
            seed=seed,
            ids=ids,
            start_frame=start_frame,
            num_frames=num_frames,
            parameters=parameters,
        )
    except scenes.SceneError as error:
        raise InputError(_sentence(str(error))) from error


def _sentence(text: str) -> str:
    return text if text.endswith(".") else f"{text}."
