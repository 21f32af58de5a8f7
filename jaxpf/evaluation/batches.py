"""Finished runs on disk: one file per batch, written whole, checked before it is believed."""

import dataclasses
import os
import re
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from jaxpf.errors import InputError
from jaxpf.files import atomic_write

FOLDER = "batches"
_NAME = re.compile(r"(\d+)-(\d+)\.npz")


@dataclasses.dataclass(frozen=True)
class Batch:
    """R runs of one configuration; T counts the frames after the start frame.

    Measures that a tracker does not give, such as the uniqueness of imported tracks, are NaN.

    Attributes:
        seeds: ``[R]`` int64, the evaluation's seed.
        runs: ``[R]`` int64, the number of each run, from 0, ascending.  Seed and run alone
            decide a run's random numbers, so that equal numbers are common to all methods.
        boxes: ``[R, T, P, 4]`` float32, estimated boxes x, y, w, h in pixels.
        uniqueness: ``[R, T, P]`` float32, distinct draws over particles.
        spread: ``[R, T, P, D]`` float32, standard deviation of the particle set.
        ess: ``[R, T]`` float32, effective sample size.
        log_evidence: ``[R, T]`` float32, increment of each frame.
        lost: ``[R, T, P]`` bool, objects without likelihood in any particle; of imported
            tracks, objects without a box.
    """

    seeds: np.ndarray
    runs: np.ndarray
    boxes: np.ndarray
    uniqueness: np.ndarray
    spread: np.ndarray
    ess: np.ndarray
    log_evidence: np.ndarray
    lost: np.ndarray

    def __len__(self) -> int:
        """R, the number of runs."""
        return len(self.runs)


class StoredBatch(NamedTuple):
    """A batch file that was read without fault.

    Attributes:
        path: of the file.
        runs: ``[R]`` the runs it holds.
    """

    path: Path
    runs: np.ndarray


def batch_path(folder: str | os.PathLike[str], configuration: int, first_run: int) -> Path:
    """Where a configuration's batch that begins with ``first_run`` is kept."""
    return Path(folder) / FOLDER / f"{configuration:04d}-{first_run:08d}.npz"


def write_batch(folder: str | os.PathLike[str], configuration: int, batch: Batch) -> Path:
    """Write a batch; the file appears only once it is complete.

    Raises:
        InputError: it cannot be written, because the disk is full for example.
    """
    path = batch_path(folder, configuration, int(batch.runs[0]))
    arrays = {field.name: getattr(batch, field.name) for field in dataclasses.fields(batch)}
    with atomic_write(path, "wb") as file:
        np.savez(file, allow_pickle=False, **arrays)
    return path


def read_batch(path: Path) -> Batch:
    """Read a batch, checksums included.

    Raises:
        InputError: the file is damaged.
    """
    names = [field.name for field in dataclasses.fields(Batch)]
    try:
        with np.load(path, allow_pickle=False) as content:
            batch = Batch(**{name: content[name] for name in names})
    # What a truncated or altered file raises depends on where it was hit.
    except (OSError, ValueError, KeyError, EOFError, NotImplementedError, zipfile.BadZipFile):
        raise InputError(
            f"the batch '{path}' is damaged; delete it and evaluate again: its runs are repeated."
        ) from None
    return batch


def batch_files(folder: str | os.PathLike[str], configuration: int) -> Iterator[Path]:
    """A configuration's batch files in the order of their runs, unread."""
    found = []
    for path in (Path(folder) / FOLDER).glob("*.npz"):
        match = _NAME.fullmatch(path.name)
        if match and int(match[1]) == configuration:
            found.append((int(match[2]), path))
    return iter(path for _, path in sorted(found))
