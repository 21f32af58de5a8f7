"""Public names that are imported when they are first used."""

from collections.abc import Callable
from typing import Any

import lazy_loader  # type: ignore[import-untyped]

from jaxpf._resembling import resembling


def attach(package: str, path: str) -> tuple[Callable[[str], Any], Callable, list[str]]:
    """``__getattr__``, ``__dir__`` and ``__all__`` by the stub beside ``path``.

    A misspelt name is refused with the one that resembles it.
    """
    getter, lister, names = lazy_loader.attach_stub(package, path)

    def get(name: str) -> object:
        try:
            return getter(name)
        except AttributeError:
            if name in names:
                raise
            near = resembling(name, names)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            # A name without its object keeps Python from adding a hint of its own.
            raise AttributeError(
                f"module {package!r} has no attribute {name!r}{hint}", name=name
            ) from None

    return get, lister, names
