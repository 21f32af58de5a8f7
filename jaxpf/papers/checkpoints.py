"""Measurements of scenes: where they are stored, to resume an experiment, and who makes them.

The command line has them by ``with keeping(folder, settings, report, pool) as measurements``;
``UNSTORED`` has neither.
"""

import contextlib
import hashlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

import jaxpf
import scenes
from jaxpf.contract.errors import InputError
from jaxpf.files.executors import Pool, in_turn
from jaxpf.files.store import Store
from jaxpf.files.writing import report_os_errors

#: Subfolder of the output folder for measurements; removed once all output is written.
NAME = "parts"

#: Function of a seed -> arrays of its scene by name.
Measure = Callable[[int], Mapping[str, Any]]


class Measurements(NamedTuple):
    """Measures the scenes of an experiment.

    Attributes:
        report: receives lines of progress.
        store: holds finished measurements; None stores nothing.
        pool: workers that measure scenes; by default this process does.
    """

    report: Callable[[str], object] = lambda line: None
    store: Store | None = None
    pool: Pool | None = None

    def of_scenes(
        self, name: str, measure: Measure, seeds: Sequence[int], threads: int = 1
    ) -> dict[str, np.ndarray]:
        """Measure the scene of each seed; arrays ``[S, ...]`` of the scenes that have one.

        Args:
            name: of the scenes, unique within the experiment, and valid as a file name.
            measure: its arrays of the first scene are all that there are.  Use
                ``functools.partial`` of a module-level function, so that it can be sent to another
                process.
            seeds: seeds of the scenes.
            threads: number of threads if there is no pool.

        Raises:
            InputError: a measurement cannot be written, or a worker died too often.
        """
        pool = self.pool
        if pool is None and threads > 1:
            pool = Pool(partial(ThreadPoolExecutor, threads), threads)
        float64 = jnp.zeros(()).dtype == jnp.float64
        pieces = {f"{name}-{seed}": (measure, seed, float64) for seed in seeds}
        made = in_turn(_measure, pieces, pool)
        if self.store is not None:
            made = self.store.made(pieces.items(), _measure, pool)
        found = {}
        for piece, arrays in made:
            found[piece] = arrays
            self.report(f"  {name}: scene {len(found)} of {len(seeds)} done")
        in_order = [found[piece] for piece in pieces]
        return {key: np.stack([x[key] for x in in_order if key in x]) for key in in_order[0]}


#: Measures in this process, in silence.
UNSTORED = Measurements()


def _measure(piece: tuple[Measure, int, bool]) -> dict[str, np.ndarray]:
    """Measure a scene, possibly in another process, with the caller's precision."""
    measure, seed, float64 = piece
    with jax.enable_x64(float64):
        return {name: np.asarray(values) for name, values in measure(seed).items()}


def can_resume(output: Path, settings: Mapping[str, Any]) -> bool:
    """Whether a folder holds measurements of the same experiment by the same program."""
    with contextlib.suppress(InputError):
        return Store(output / NAME).settings() == _described(settings)
    return False


@contextlib.contextmanager
def keeping(
    output: Path,
    settings: Mapping[str, Any],
    report: Callable[[str], object] = UNSTORED.report,
    pool: Pool | None = None,
) -> Iterator[Measurements]:
    """Store measurements in an output folder until the block ends without an error.

    Args:
        output: an existing folder.
        settings: everything that measurements depend on, as JSON values; those with other settings
            are removed.
        report: receives lines of progress.
        pool: workers that measure scenes; by default this process does.

    Raises:
        InputError: the folder cannot be written.
    """
    store = Store(output / NAME)
    if not can_resume(output, settings):
        with report_os_errors("write", store.folder):
            store.remove()
        store.begin(_described(settings))
    try:
        yield Measurements(report, store, pool)
    except BaseException:
        if not store.names():  # nothing to resume
            store.remove()
        raise
    store.remove()


def _described(settings: Mapping[str, Any]) -> dict[str, Any]:
    """The settings with a digest of the program, since code changes may change results."""
    digest = hashlib.sha256()
    for package in (jaxpf, scenes):
        for file in sorted(Path(package.__path__[0]).rglob("*.py")):
            digest.update(file.read_bytes())
    return {**settings, "program": digest.hexdigest()}
