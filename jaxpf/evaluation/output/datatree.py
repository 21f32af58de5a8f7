"""Exports an evaluation in ArviZ's layout: runs are chains, frames are draws.

``posterior`` holds the estimated shapes (for boxes x, y, w, h), ``sample_stats`` the filter's
diagnostics, and ``observed_data`` the truth.  Imported tracks have no runs and are left out.
"""

from pathlib import Path
from typing import Any

import numpy as np

from jaxpf.contract.errors import InputError
from jaxpf.evaluation.results import Results
from jaxpf.evaluation.summary import configuration_name
from jaxpf.files.writing import atomic_path

#: Fields of a batch in ``sample_stats`` -> dimensions beyond the common ones.
_STATISTICS: dict[str, list[str]] = {
    "ess": [],
    "log_evidence": [],
    "uniqueness": ["object"],
    "confidence": ["object"],
    "without_likelihood": ["object"],
    "spread": ["object", "coordinate"],
}


def datatree(results: Results) -> Any:
    """Make an ``xarray.DataTree`` of all configurations with runs.

    Returns:
        Variables with dimensions chain, draw, configuration, object, ...; NaN for runs that a
        configuration has not finished.

    Raises:
        InputError: arviz-base is missing, or there are no runs.
    """
    try:
        import arviz_base
    except ModuleNotFoundError:
        raise InputError(
            "ArviZ's files need arviz-base, which is missing; pip install 'jaxpf[formats]'."
        ) from None

    ran = [each for each in results.configurations if not each.is_imported]
    batches = {place: list(results.batches(each)) for place, each in enumerate(ran)}
    batches = {place: each for place, each in batches.items() if each}
    if not batches:
        raise InputError(f"'{results.folder}' holds no runs; evaluate first.")

    def of_runs(field: str) -> np.ndarray:
        """Values of a field, ``[R, T, C, ...]``, with NaN for missing runs."""
        by_place = {
            place: np.concatenate([getattr(batch, field) for batch in each])
            for place, each in batches.items()
        }
        most, shape = max(map(len, by_place.values())), next(iter(by_place.values())).shape[1:]
        filled = np.full((most, len(ran), *shape), np.nan)
        for place, values in by_place.items():
            filled[: len(values), place] = values
        return np.moveaxis(filled, 1, 2)

    dims = {name: ["configuration", *more] for name, more in _STATISTICS.items()}
    frames = results.start_frame + 1 + np.arange(len(results.truth))
    return arviz_base.from_dict(
        {
            "posterior": {"estimate": of_runs("shapes")},
            "sample_stats": {name: of_runs(name) for name in _STATISTICS},
            "observed_data": {"truth": results.truth},
        },
        dims={
            "estimate": ["configuration", "object", "value"],
            "truth": ["frame", "object", "value"],
            **dims,
        },
        coords={
            "draw": frames,
            "frame": frames,
            "configuration": [configuration_name(results, each) for each in ran],
            "object": list(results.object_ids),
        },
        attrs={"/": {"inference_library": "jaxpf", "scene": results.scene_name}},
    )


def write_datatree(path: Path, results: Results) -> None:
    """Write ``datatree`` as netCDF.

    Raises:
        InputError: as for ``datatree``; the file cannot be written.
    """
    tree = datatree(results)
    with atomic_path(path) as temporary:
        tree.to_netcdf(temporary, engine="h5netcdf")
