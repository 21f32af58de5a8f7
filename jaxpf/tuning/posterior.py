"""Draws of parameters from their posterior."""

from typing import Any

import jax
import numpy as np

from jaxpf.contract.errors import InputError, import_extra
from jaxpf.contract.pytree import pytree_dataclass, static_field
from jaxpf.running.simulation import central_interval


@pytree_dataclass
class Posterior:
    """Draws of parameters from C chains, S draws each, after warm-up.

    Attributes:
        parameters: pytree of the parameters; leaves ``[C, S, ...]``.
        log_evidence: ``[C, S]``, the estimate with which each draw was accepted.
        log_prior: ``[C, S]``.
        accepted: ``[C, S]`` bool, whether the move was accepted.
        num_particles: number of particles of the filters.
        paths: ``[C, S, T, P, D]``, a trajectory of the states with each draw, for states that are
            pytrees those of ``[C, S, T, ...]``; None unless requested.
        frames: ``[C, S, T, ...]``, observations drawn given each trajectory and its parameters:
            predictive draws, of missing frames too; None without paths, or if the likelihood has
            no ``sample`` or sees the previous state.
    """

    parameters: Any
    log_evidence: jax.Array
    log_prior: jax.Array
    accepted: jax.Array
    num_particles: int = static_field()
    paths: Any = None
    frames: Any = None

    def interval(self, level: float = 0.95) -> tuple[Any, Any]:
        """Ends of the central predictive intervals of the observations, ``[T, ...]``."""
        if self.frames is None:
            raise InputError(
                "the posterior holds no observations; give pmmh paths=True, and the model an "
                "observation."
            )
        return central_interval(self.frames, level, (0, 1))

    def datatree(self) -> Any:
        """An ``xarray.DataTree`` in ArviZ's layout, for ``arviz_stats.summary`` and plots."""
        need = "ArviZ's trees need arviz-base"
        arviz_base = import_extra("arviz_base", need, "'jaxpf[formats]'")
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
