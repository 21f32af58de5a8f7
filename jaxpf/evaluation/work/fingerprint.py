"""Fingerprints a scene's files, to detect changes without opening the scene."""

import functools
import hashlib
from pathlib import Path
from typing import Any

#: Small text files, compared by content; image and video files are compared by size and mtime.
_TEXTS = {".csv", ".json", ".txt", ".ini", ".py"}


def fingerprint(scene: Any) -> str | None:
    """Digest of the files behind a scene; None if there are no files or they are unknown.

    Equal fingerprints mean the same files.  Different ones do not imply different pictures; the
    scene's own digest decides.

    Args:
        scene: of a ``Plan``.  The files are known if it is a ``functools.partial`` with
            ``source=...``, a folder or ``file.py:function``.
    """
    source = scene.keywords.get("source") if isinstance(scene, functools.partial) else None
    if not isinstance(source, str):
        return None
    path = Path(source)
    if not path.is_dir():
        path = Path(source.rpartition(":")[0])
        return _digest([path]) if path.suffix == ".py" and path.is_file() else None
    return _digest(sorted(file for file in path.rglob("*") if file.is_file()))


def _digest(files: list[Path]) -> str:
    digest = hashlib.sha256()
    for file in files:
        about = file.stat()
        digest.update(f"{file}\0{about.st_size}\0".encode("utf-8", "surrogateescape"))
        if file.suffix.lower() in _TEXTS:
            digest.update(file.read_bytes())
        else:
            digest.update(f"{about.st_mtime_ns}".encode())
    return digest.hexdigest()
