"""Batches of runs, the pieces of an evaluation's store."""

import dataclasses

import numpy as np

FOLDER = "batches"


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


#: Names of the arrays of a batch.
FIELDS = tuple(field.name for field in dataclasses.fields(Batch))


def batch_name(configuration: int, first_run: int) -> str:
    """Name of a batch in the store, by the index of its configuration."""
    return f"{configuration:04d}-{first_run:08d}"


def batch_names(configuration: int) -> str:
    """A pattern of the names of a configuration's batches, which sort by their runs."""
    return f"{configuration:04d}-{'[0-9]' * 8}"
