"""Whether the files that a scene comes from are those of before, told without opening it."""

import functools
import hashlib
from pathlib import Path
from typing import Any

#: Small files whose text is compared; of others, which hold pictures, size and time of change.
_TEXTS = {".csv", ".json", ".txt", ".ini", ".py"}


def fingerprint(scene: Any) -> str | None:
    """A digest of the files behind a scene; None where there are none, or nobody tells.

    Two equal ones mean the same files.  Different ones need not mean other pictures: the scene's
    own digest decides.

    Args:
        scene: of a ``Plan``; ``functools.partial`` of a function with ``source=...``, which is a
            folder or ``file.py:function``, tells where its files are.
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
