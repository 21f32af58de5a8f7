"""Columns that a track gets from particles, without a run."""

from types import SimpleNamespace

import numpy as np

from jaxpf.cli.tracking.columns import places_of


def columns_of(target, start, particles, error, slots=slice(None)):
    """Columns of particles ``[N, P, D]`` that weigh the same, given the model's declared error."""
    weights = np.full(len(particles), -np.log(len(particles)))
    group = SimpleNamespace(
        start=start,
        shapes=start.shapes,
        slots=slots,
        state=SimpleNamespace(substates=particles, log_weights=weights),
        tracker=SimpleNamespace(likelihood=SimpleNamespace(model_error=error)),
    )
    return places_of(target, group, start.shapes[:, :2], 1 / 25)[0]
