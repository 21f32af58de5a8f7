"""Finished runs on disk: one file per batch, written atomically and verified when read."""

import dataclasses
import os
import re
from pathlib import Path

import numpy as np

from jaxpf.files.pieces import Pieces

FOLDER = "batches"
_REMEDY = "evaluate again, which repeats its runs alone"
_NAME = re.compile(r"\d+-\d+\.npz")


@dataclasses.dataclass(frozen=True)
class Batch:
    """R runs of one configuration over the T frames after the start frame.

    Measures that a tracker lacks, such as the share of distinct particles of imported
    tracks, are NaN.

    Attributes:
        seeds: ``[R]`` int64, the evaluation's seed.
        runs: ``[R]`` int64, run numbers from 0, ascending.  Seed and run number determine the
            random numbers of a run, so all methods share them.
        shapes: ``[R, T, P, S]`` float32, estimated shapes, see ``jaxpf.targets.target``; for
            boxes x, y, w, h in pixels.
        distinct_share: ``[R, T, P]`` float32, distinct draws over particles.
        spread: ``[R, T, P, D]`` float32, standard deviation of the particle set.
        model_error: ``[R, P, 3]`` float32, see ``jaxpf.contract.Likelihood``.
        confidence: ``[R, T, P]`` float32, 0 to 1, see ``jaxpf.contract.Summary``.
        ess: ``[R, T]`` float32, effective sample size.
        log_evidence: ``[R, T]`` float32, increment per frame.
        without_likelihood: ``[R, T, P]`` bool, whether an object has zero likelihood in every
            particle; for imported tracks, whether it has no box.
    """

    seeds: np.ndarray
    runs: np.ndarray
    shapes: np.ndarray
    distinct_share: np.ndarray
    spread: np.ndarray
    model_error: np.ndarray
    confidence: np.ndarray
    ess: np.ndarray
    log_evidence: np.ndarray
    without_likelihood: np.ndarray

    def __len__(self) -> int:
        """Number of runs, R."""
        return len(self.runs)


def write_batch(folder: str | os.PathLike[str], configuration: int, batch: Batch) -> Path:
    """Write a batch; the file appears only when it is complete.

    Raises:
        InputError: the file cannot be written, for example because the disk is full.
    """
    arrays = {field.name: getattr(batch, field.name) for field in dataclasses.fields(batch)}
    name = f"{configuration:04d}-{int(batch.runs[0]):08d}"
    return Pieces(Path(folder) / FOLDER).write(name, arrays)


def read_batch(path: Path) -> Batch:
    """Read a batch and verify its checksums.

    Raises:
        Damaged: the file is.
    """
    with Pieces(path.parent, _REMEDY).opened(path.stem) as content:
        return Batch(**{field.name: content[field.name] for field in dataclasses.fields(Batch)})


def batch_files(folder: str | os.PathLike[str], configuration: int) -> list[Path]:
    """Paths of a configuration's batch files, in the order of their runs."""
    paths = (Path(folder) / FOLDER).glob(f"{configuration:04d}-*.npz")
    return sorted(path for path in paths if _NAME.fullmatch(path.name))
