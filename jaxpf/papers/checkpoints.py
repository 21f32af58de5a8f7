"""Parts of a long experiment, stored on disk so that it can resume.

An experiment names each part and the function that measures it, and ``each`` yields them in order.
The command line sets the folder, and the pool of workers that measure parts: ``with
keeping(folder, settings, pool)``.  Outside such a block nothing is stored.
"""

import contextlib
import contextvars
import hashlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from jaxpf.contract.errors import InputError
from jaxpf.evaluation.work.schedule import double_precision
from jaxpf.files.executors import Pool, in_turn
from jaxpf.files.store import Store
from jaxpf.files.writing import report_os_errors

#: Subfolder of the output folder for parts; removed once all output is written.
NAME = "parts"

#: Function that measures a part: arrays by name.
Measure = Callable[[], Mapping[str, Any]]
Arrays = dict[str, np.ndarray]

#: Where to store parts, and who measures them.
_kept: contextvars.ContextVar[tuple[Store | None, Pool | None]]
_kept = contextvars.ContextVar("parts", default=(None, None))


def each(parts: Iterable[tuple[str, Measure]], threads: int = 1) -> Iterator[Arrays]:
    """Read or measure each part; yields them in order.

    Args:
        parts: name, a valid file name that is unique within the experiment, and function.  Use
            ``functools.partial`` of a module-level function, so that it can be sent to another
            process.
        threads: number of threads if there is no pool.

    Raises:
        InputError: a part cannot be written, or a worker died too often.
    """
    store, pool = _kept.get()
    if pool is None and threads > 1:
        pool = Pool(partial(ThreadPoolExecutor, threads), threads)
    pieces = {name: (measure, double_precision()) for name, measure in parts}
    found = in_turn(_measure, pieces, pool)
    if store is not None:
        found = store.made(pieces.items(), _measure, pool)
    waiting, done = [*pieces], dict[str, Arrays]()
    for name, arrays in found:
        done[name] = arrays
        while waiting and waiting[0] in done:
            yield done.pop(waiting.pop(0))


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


def _measure(part: tuple[Measure, bool]) -> Arrays:
    """Measure a part, possibly in another process, with this process's precision."""
    import jax

    measure, float64 = part
    with jax.enable_x64(float64):
        return {name: np.asarray(values) for name, values in measure().items()}


def can_resume(output: Path, settings: Mapping[str, Any]) -> bool:
    """Whether a folder holds parts of the same experiment by the same program."""
    with contextlib.suppress(InputError):
        return Store(output / NAME).settings() == _described(settings)
    return False


@contextlib.contextmanager
def keeping(output: Path, settings: Mapping[str, Any], pool: Pool | None = None) -> Iterator[None]:
    """Store parts in an output folder until the block ends without an error.

    Args:
        output: an existing folder.
        settings: everything that parts depend on, as JSON values; parts with other settings are
            removed.
        pool: workers that measure parts; by default this process does.

    Raises:
        InputError: the folder cannot be written.
    """
    store = Store(output / NAME)
    if not can_resume(output, settings):
        with report_os_errors("write", store.folder):
            store.remove()
        store.begin(_described(settings))
    token, done = _kept.set((store, pool)), False
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
