"""Opens scenes for evaluations: drawn ones and recordings."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import scenes
from jaxpf.contract.errors import Argument, InputError
from jaxpf.contract.numbers import plain
from jaxpf.sequences import open_sequence


def load_scene(
    source: Any,
    seed: int = 0,
    ids: Sequence[int] | None = None,
    start_frame: int | None = None,
    num_frames: int | None = None,
    parameters: Mapping[str, Any] | None = None,
) -> scenes.Scene:
    """Open a scene from any source; picklable, for ``functools.partial`` and worker processes.

    Args:
        source: a name or a function, see ``scenes.open_scene``, or the folder of a recorded
            sequence; write ``./distracter`` for a folder with the name of a drawn scene.
        seed: of drawn scenes.
        ids, start_frame, num_frames: of recordings, see ``jaxpf.sequences.Sequence.scene``.
        parameters: of drawn scenes, by name.

    Raises:
        InputError: the scene cannot be opened.
    """
    if _is_folder(source):
        if parameters:
            raise InputError(
                f"{source} is a recorded sequence and has no parameters, but "
                f"{', '.join(map(repr, parameters))} was given."
            )
        return open_sequence(source).scene(ids, start_frame, num_frames)
    for name, value in {"ids": ids, "start_frame": start_frame, "num_frames": num_frames}.items():
        if value is not None:
            raise InputError(
                Argument(name, repr(value), typed=plain(value)),
                f" chooses from a recorded sequence, but the scene {source!r} is drawn by a "
                "function; set its own parameters instead.",
            )
    try:
        return scenes.open_scene(source, seed=seed, parameters=parameters)
    except scenes.SceneError as error:
        raise as_input_error(error) from error


def _is_folder(source: Any) -> bool:
    """Whether ``source`` is or looks like a folder, and is neither a name nor a function."""
    if isinstance(source, Path):
        return True
    if not isinstance(source, str) or source in scenes.names():
        return False
    return Path(source).exists() or ("/" in source and not scenes.names_function(source))


def as_input_error(error: scenes.SceneError) -> InputError:
    """Convert a ``SceneError`` to an ``InputError`` with the same message."""
    return InputError(f"{str(error).removesuffix('.')}.")
