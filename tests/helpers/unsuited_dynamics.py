"""Dynamics that do not work with a proposal."""

import jaxpf
from jaxpf import pytree_dataclass


@pytree_dataclass
class Blind:
    """Moves of no known density."""

    def propagate(self, key, partition, current, previous, parent):
        return current


@pytree_dataclass
class Coupled(jaxpf.contract.CoupledDynamics):
    """Moves by everything that was before."""

    def propagate(self, key, partition, current, previous, parent, others):
        return current
