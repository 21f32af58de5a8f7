"""Parts of a long experiment, which are not measured again when it goes on after a stop.

An experiment names what it measures, ``part("fish-3", measure)``; the command line says where parts
are kept, ``with keeping(folder, settings)``.  Without that they are measured, and nothing is kept.
"""

import contextlib
import contextvars
import hashlib
import json
import shutil
import zipfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from jaxpf.files.writing import atomic_write, report_os_errors

#: Folder of parts within the output folder; it goes when all is written.
NAME = "parts"
_SETTINGS = "settings.json"

_folder: contextvars.ContextVar[Path | None] = contextvars.ContextVar("parts", default=None)


def part(name: str, measure: Callable[[], Mapping[str, np.ndarray]]) -> dict[str, np.ndarray]:
    """What was measured before under that name, else what is measured now.

    Args:
        name: fit for a file; one for each part of an experiment.
        measure: gives arrays by name.

    Raises:
        InputError: the part cannot be written.
    """
    folder = _folder.get()
    if folder is None:
        return dict(measure())
    path = folder / f"{name}.npz"
    # A damaged file is measured again.
    with contextlib.suppress(OSError, ValueError, zipfile.BadZipFile), np.load(path) as kept:
        return {key: kept[key] for key in kept.files}
    found = {key: np.asarray(value) for key, value in measure().items()}
    with atomic_write(path, "wb") as file:
        np.savez(file, **found)  # type: ignore[arg-type]
    return found


def can_go_on(output: Path, settings: Mapping[str, Any]) -> bool:
    """Whether a folder holds parts of the same experiment, measured by the same program."""
    with contextlib.suppress(OSError, ValueError):
        text = (output / NAME / _SETTINGS).read_text(encoding="utf-8")
        return json.loads(text) == _described(settings)
    return False


@contextlib.contextmanager
def keeping(output: Path, settings: Mapping[str, Any]) -> Iterator[None]:
    """Keep parts in an output folder until the block ends well, or with none measured.

    Args:
        output: an existing folder.
        settings: what parts depend on, fit for JSON; parts of other settings are removed.

    Raises:
        InputError: the folder cannot be written.
    """
    folder = output / NAME
    if not can_go_on(output, settings):
        with report_os_errors("write", folder):
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir()
        with atomic_write(folder / _SETTINGS) as file:
            json.dump(_described(settings), file)
    token, done = _folder.set(folder), False
    try:
        yield
        done = True
    finally:
        _folder.reset(token)
        if done or not any(folder.glob("*.npz")):
            shutil.rmtree(folder, ignore_errors=True)


def _described(settings: Mapping[str, Any]) -> dict[str, Any]:
    """The settings, and a digest of the program: another one might measure otherwise."""
    import jaxpf
    import scenes

    digest = hashlib.sha256()
    for package in (jaxpf, scenes):
        for file in sorted(Path(package.__path__[0]).rglob("*.py")):
            digest.update(file.read_bytes())
    return {**settings, "program": digest.hexdigest()}
