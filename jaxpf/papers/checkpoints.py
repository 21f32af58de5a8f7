"""Parts of a long experiment, stored on disk so that it can resume.

An experiment names each part, ``part("fish-3", measure)``; the command line sets the folder,
``with keeping(folder, settings)``.  Outside such a block nothing is stored.  ``each`` measures
independent parts: it distributes them over the workers of an executor (``with sharing(executor)``)
and yields them in order.
"""

import contextlib
import contextvars
import hashlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jaxpf.contract.errors import InputError
from jaxpf.evaluation.work.execution import Pool, in_turn
from jaxpf.evaluation.work.schedule import double_precision
from jaxpf.files.pieces import Damaged, Pieces
from jaxpf.files.writing import report_os_errors

#: Subfolder of the output folder for parts; removed once all output is written.
NAME = "parts"

#: Function that measures a part: arrays by name.
Measure = Callable[[], Mapping[str, Any]]

_store: contextvars.ContextVar[Pieces | None] = contextvars.ContextVar("parts", default=None)
_executor: contextvars.ContextVar[Pool | None] = contextvars.ContextVar("workers", default=None)


def part(name: str, measure: Measure) -> dict[str, Any]:
    """Read a stored part, or measure it now.

    Args:
        name: valid file name, unique within the experiment.
        measure: see ``Measure``.

    Raises:
        InputError: the part cannot be written.
    """
    stored = _known(name)
    return _kept(name, _arrays(measure)) if stored is None else stored


def each(parts: Iterable[tuple[str, Measure]], threads: int = 1) -> Iterator[dict[str, Any]]:
    """Yield ``part`` for each of them in order.

    Args:
        parts: name and function.  Use ``functools.partial`` of a module-level function, so that it
            can be sent to another process.
        threads: number of threads if there is no executor.

    Raises:
        InputError: a part cannot be written, or a worker died too often.
    """
    executor = _executor.get()
    if executor is None and threads == 1:
        for name, measure in parts:
            yield part(name, measure)
        return
    pieces = [_Piece(name, measure, double_precision()) for name, measure in parts]
    stored = {piece.name: _known(piece.name) for piece in pieces}
    missing = [piece for piece in pieces if stored[piece.name] is None]
    measured = in_turn(_measure, missing, executor or partial(ThreadPoolExecutor, threads))
    for piece in pieces:
        while (values := stored[piece.name]) is None:
            done, flat = next(measured)
            stored[done.name] = _kept(done.name, flat)
        yield values
        del stored[piece.name]


def of_scenes(
    name: str,
    measure: Callable[[int], Mapping[str, Any]],
    seeds: Sequence[int],
    report: Callable[[str], None],
    threads: int = 1,
) -> dict[str, np.ndarray]:
    """Measure the scene of each seed, a part each; arrays ``[S, ...]`` of the scenes that have one.

    Args:
        name: of the scenes; the parts are ``NAME-SEED``.
        measure: function of a seed -> arrays of its scene by name; a ``functools.partial`` of a
            module-level function, so that it can be sent to another process.
        seeds: seeds of the scenes; the first scene has all arrays.
        report: receives a line per scene.
        threads: see ``each``.
    """
    found: list[dict[str, Any]] = []
    for arrays in each(((f"{name}-{seed}", partial(measure, seed)) for seed in seeds), threads):
        found.append(arrays)
        report(f"  {name}: scene {len(found)} of {len(seeds)} done")
    return {key: np.stack([arrays[key] for arrays in found if key in arrays]) for key in found[0]}


@contextlib.contextmanager
def sharing(executor: Pool | None) -> Iterator[None]:
    """Within the block, ``each`` sends parts to workers of new executors; None for none."""
    token = _executor.set(executor)
    try:
        yield
    finally:
        _executor.reset(token)


class _Piece(NamedTuple):
    """A part to measure, possibly in another process, with this process's precision."""

    name: str
    measure: Measure
    float64: bool

    def __str__(self) -> str:
        return self.name


def _measure(piece: _Piece, attempt: int) -> dict[str, np.ndarray]:
    import jax

    with jax.enable_x64(piece.float64):
        return _arrays(piece.measure)


def _arrays(measure: Measure) -> dict[str, np.ndarray]:
    return {name: np.asarray(values) for name, values in measure().items()}


def _known(name: str) -> dict[str, Any] | None:
    """A stored part; None if it is missing or damaged."""
    store = _store.get()
    if store is not None:
        with contextlib.suppress(Damaged), store.opened(name) as arrays:
            return dict(arrays)
    return None


def _kept(name: str, arrays: Mapping[str, np.ndarray]) -> dict[str, Any]:
    store = _store.get()
    if store is not None:
        store.write(name, arrays)
    return dict(arrays)


def can_resume(output: Path, settings: Mapping[str, Any]) -> bool:
    """Whether a folder holds parts of the same experiment by the same program."""
    with contextlib.suppress(InputError):
        return Pieces(output / NAME).settings() == _described(settings)
    return False


@contextlib.contextmanager
def keeping(output: Path, settings: Mapping[str, Any]) -> Iterator[None]:
    """Store parts in an output folder until the block ends without an error.

    Args:
        output: an existing folder.
        settings: everything that parts depend on, as JSON values; parts with other settings are
            removed.

    Raises:
        InputError: the folder cannot be written.
    """
    store = Pieces(output / NAME)
    if not can_resume(output, settings):
        with report_os_errors("write", store.folder):
            store.remove()
        store.begin(_described(settings))
    token, done = _store.set(store), False
    try:
        yield
        done = True
    finally:
        _store.reset(token)
        if done or not any(store.folder.glob("*.npz")):
            store.remove()


def _described(settings: Mapping[str, Any]) -> dict[str, Any]:
    """The settings with a digest of the program, since code changes may change results."""
    import jaxpf
    import scenes

    digest = hashlib.sha256()
    for package in (jaxpf, scenes):
        for file in sorted(Path(package.__path__[0]).rglob("*.py")):
            digest.update(file.read_bytes())
    return {**settings, "program": digest.hexdigest()}
