"""Draws of parameters from their posterior."""

from typing import Any

import jax
import numpy as np

from jaxpf.contract.errors import InputError
from jaxpf.contract.pytree import pytree_dataclass, static_field


@pytree_dataclass
class Posterior:
    """Draws of parameters from C chains, S draws each, after warm-up.

    Attributes:
        parameters: pytree of the parameters; leaves ``[C, S, ...]``.
        log_evidence: ``[C, S]``, the estimate with which each draw was accepted.
        log_prior: ``[C, S]``.
        accepted: ``[C, S]`` bool, whether the move was accepted.
        num_particles: number of particles of the filters.
        paths: ``[C, S, T, P, D]``, a trajectory of the states with each draw; None unless
            requested.
    """

    parameters: Any
    log_evidence: jax.Array
    log_prior: jax.Array
    accepted: jax.Array
    num_particles: int = static_field()
    paths: Any = None

    def datatree(self) -> Any:
        """An ``xarray.DataTree`` in ArviZ's layout, for ``arviz_stats.summary`` and plots."""
        try:
            import arviz_base
        except ModuleNotFoundError:
            raise InputError(
                "ArviZ's trees need arviz-base, which is missing; pip install 'jaxpf[formats]'."
            ) from None
        leaves = jax.tree_util.tree_leaves_with_path(self.parameters)
        groups = {
            "posterior": {
                jax.tree_util.keystr(path, simple=True, separator=".") or "parameter": leaf
                for path, leaf in leaves
            },
            "sample_stats": {
                "lp": self.log_evidence + self.log_prior,
                "log_evidence": self.log_evidence,
                "accepted": self.accepted,
            },
        }
        attributes = {"inference_library": "jaxpf", "num_particles": self.num_particles}
        return arviz_base.from_dict(jax.tree.map(np.asarray, groups), attrs={"/": attributes})
