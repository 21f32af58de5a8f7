"""Parts of a long experiment, stored on disk so that it can resume.

An experiment names each part and the function that measures it, and ``each`` yields them in order.
The command line sets the folder, and the executor over whose workers parts are distributed: ``with
keeping(folder, settings, executor)``.  Outside such a block nothing is stored.
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
Arrays = dict[str, np.ndarray]

#: Where to store parts, and who measures them.
_kept: contextvars.ContextVar[tuple[Pieces | None, Pool | None]]
_kept = contextvars.ContextVar("parts", default=(None, None))


def each(parts: Iterable[tuple[str, Measure]], threads: int = 1) -> Iterator[Arrays]:
    """Read or measure each part; yields them in order.

    Args:
        parts: name, a valid file name that is unique within the experiment, and function.  Use
            ``functools.partial`` of a module-level function, so that it can be sent to another
            process.
        threads: number of threads if there is no executor.

    Raises:
        InputError: a part cannot be written, or a worker died too often.
    """
    store, executor = _kept.get()
    factory = executor or (partial(ThreadPoolExecutor, threads) if threads > 1 else None)
    names: list[str] = []
    done: dict[str, Arrays] = {}

    def missing() -> Iterator[_Part]:
        for name, measure in parts:
            names.append(name)
            if store is not None:
                with contextlib.suppress(Damaged), store.opened(name) as arrays:
                    done[name] = dict(arrays)
                    continue
            yield _Part(name, measure, double_precision())

    for part, arrays in in_turn(_measure, missing(), factory):
        if store is not None:
            store.write(part.name, arrays)
        done[part.name] = arrays
        while names and names[0] in done:
            yield done.pop(names.pop(0))
    yield from map(done.pop, names)


def of_scenes(
    name: str,
    measure: Callable[[int], Mapping[str, Any]],
    seeds: Sequence[int],
    report: Callable[[str], None],
    threads: int = 1,
) -> Arrays:
    """Measure the scene of each seed, a part each; arrays ``[S, ...]`` of the scenes that have one.

    Args:
        name: of the scenes; the parts are ``NAME-SEED``.
        measure: function of a seed -> arrays of its scene by name; see ``each``.
        seeds: seeds of the scenes; the first scene has all arrays.
        report: receives a line per scene.
        threads: see ``each``.
    """
    found: list[Arrays] = []
    for arrays in each(((f"{name}-{seed}", partial(measure, seed)) for seed in seeds), threads):
        found.append(arrays)
        report(f"  {name}: scene {len(found)} of {len(seeds)} done")
    return {key: np.stack([arrays[key] for arrays in found if key in arrays]) for key in found[0]}


class _Part(NamedTuple):
    """A part to measure, possibly in another process, with this process's precision."""

    name: str
    measure: Measure
    float64: bool

    def __str__(self) -> str:
        return self.name


def _measure(part: _Part, attempt: int) -> Arrays:
    import jax

    with jax.enable_x64(part.float64):
        return {name: np.asarray(values) for name, values in part.measure().items()}


def can_resume(output: Path, settings: Mapping[str, Any]) -> bool:
    """Whether a folder holds parts of the same experiment by the same program."""
    with contextlib.suppress(InputError):
        return Pieces(output / NAME).settings() == _described(settings)
    return False


@contextlib.contextmanager
def keeping(
    output: Path, settings: Mapping[str, Any], executor: Pool | None = None
) -> Iterator[None]:
    """Store parts in an output folder until the block ends without an error.

    Args:
        output: an existing folder.
        settings: everything that parts depend on, as JSON values; parts with other settings are
            removed.
        executor: makes executors whose workers measure parts; by default this process does.

    Raises:
        InputError: the folder cannot be written.
    """
    store = Pieces(output / NAME)
    if not can_resume(output, settings):
        with report_os_errors("write", store.folder):
            store.remove()
        store.begin(_described(settings))
    token, done = _kept.set((store, executor)), False
    try:
        yield
        done = True
    finally:
        _kept.reset(token)
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
