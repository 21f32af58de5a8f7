"""Parts of a long experiment, which are not measured again when it goes on after a stop.

An experiment names what it measures, ``part("fish-3", measure)``; the command line says where parts
are kept, ``with keeping(folder, settings)``.  Without that they are measured, and nothing is kept.

Parts that do not need one another are measured by ``each``, which the workers of an executor share
``with sharing(executor)``.  What is timed is measured here, one after another.
"""

import contextlib
import contextvars
import hashlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jaxpf.contract.errors import InputError
from jaxpf.evaluation.work.execution import Factory, in_turn
from jaxpf.evaluation.work.schedule import double_precision
from jaxpf.files.store import Damaged, Store
from jaxpf.files.writing import report_os_errors

#: Folder of parts within the output folder; it goes when all is written.
NAME = "parts"

#: Function that gives what is measured: arrays by name, or mappings of such.
Measure = Callable[[], Mapping[str, Any]]

_store: contextvars.ContextVar[Store | None] = contextvars.ContextVar("parts", default=None)
_executor: contextvars.ContextVar[Factory | None] = contextvars.ContextVar("workers", default=None)


def part(name: str, measure: Measure) -> dict[str, Any]:
    """What was measured before under that name, else what is measured now.

    Args:
        name: fit for a file; one for each part of an experiment.
        measure: see ``Measure``.

    Raises:
        InputError: the part cannot be written.
    """
    known = _known(name)
    return _kept(name, dict(_flat(measure()))) if known is None else known


def each(parts: Iterable[tuple[str, Measure]], threads: int = 1) -> Iterator[dict[str, Any]]:
    """As ``part`` for each of them, in their order.

    Args:
        parts: name and function; a function of a module and what it is called with, see
            ``functools.partial``, so that it can be sent to another process.
        threads: that share the work where nobody else does.

    Raises:
        InputError: a part cannot be written, or a worker died once too often.
    """
    executor = _executor.get()
    if executor is None and threads == 1:
        for name, measure in parts:
            yield part(name, measure)
        return
    pieces = [_Piece(name, measure, double_precision()) for name, measure in parts]
    found = {piece.name: _known(piece.name) for piece in pieces}
    missing = [piece for piece in pieces if found[piece.name] is None]
    measured = in_turn(_measure, missing, executor or partial(ThreadPoolExecutor, threads))
    for piece in pieces:
        while (its := found[piece.name]) is None:
            done, flat = next(measured)
            found[done.name] = _kept(done.name, flat)
        yield its
        del found[piece.name]


@contextlib.contextmanager
def sharing(executor: Factory | None) -> Iterator[None]:
    """Within the block, ``each`` gives parts to the workers of new executors; None for none."""
    token = _executor.set(executor)
    try:
        yield
    finally:
        _executor.reset(token)


class _Piece(NamedTuple):
    """A part that somebody else may measure, in this process's precision."""

    name: str
    measure: Measure
    float64: bool

    def __str__(self) -> str:
        return self.name


def _measure(piece: _Piece, attempt: int) -> dict[str, np.ndarray]:
    import jax

    with jax.enable_x64(piece.float64):
        return dict(_flat(piece.measure()))


def _known(name: str) -> dict[str, Any] | None:
    """What was measured before; None where nothing was, or it is damaged."""
    store = _store.get()
    if store is not None:
        with contextlib.suppress(Damaged):
            return _nested(store.read(name))
    return None


def _kept(name: str, found: Mapping[str, np.ndarray]) -> dict[str, Any]:
    store = _store.get()
    if store is not None:
        store.write(name, found)
    return _nested(found)


#: Between the names of nested mappings.
_WITHIN = " > "


def _flat(found: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, np.ndarray]]:
    for key, value in found.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{above}{key}{_WITHIN}")
        else:
            yield above + key, np.asarray(value)


def _nested(found: Mapping[str, np.ndarray]) -> dict[str, Any]:
    nested: dict[str, Any] = {}
    for path, value in found.items():
        *above, key = path.split(_WITHIN)
        place = nested
        for name in above:
            place = place.setdefault(name, {})
        place[key] = value
    return nested


def can_go_on(output: Path, settings: Mapping[str, Any]) -> bool:
    """Whether a folder holds parts of the same experiment, measured by the same program."""
    with contextlib.suppress(InputError):
        return Store(output / NAME).settings() == _described(settings)
    return False


@contextlib.contextmanager
def keeping(output: Path, settings: Mapping[str, Any], for_good: bool = False) -> Iterator[None]:
    """Keep parts in an output folder until the block ends well, or with none measured.

    Args:
        output: an existing folder.
        settings: what parts depend on, fit for JSON; parts of other settings are removed.
        for_good: keep them also where the block ends well.

    Raises:
        InputError: the folder cannot be written.
    """
    store = Store(output / NAME)
    if not can_go_on(output, settings):
        with report_os_errors("write", store.folder):
            store.remove()
        store.begin(_described(settings))
    token, done = _store.set(store), False
    try:
        yield
        done = True
    finally:
        _store.reset(token)
        if (done and not for_good) or not any(store.folder.glob("*.npz")):
            store.remove()


def _described(settings: Mapping[str, Any]) -> dict[str, Any]:
    """The settings, and a digest of the program: another one might measure otherwise."""
    import jaxpf
    import scenes

    digest = hashlib.sha256()
    for package in (jaxpf, scenes):
        for file in sorted(Path(package.__path__[0]).rglob("*.py")):
            digest.update(file.read_bytes())
    return {**settings, "program": digest.hexdigest()}
