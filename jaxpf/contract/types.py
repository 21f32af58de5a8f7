"""Types of what users write: a class needs the methods alone, see ``jaxpf.contract.interface``."""

from collections.abc import Callable
from typing import Any, Protocol

import jax
import numpy as np

#: Substates ``[P, D]`` before the first frame, or a sampler of them.
Initial = jax.Array | np.ndarray | Callable[[jax.Array], jax.Array]


class TrackerLike(Protocol):
    """A tracker, inherited or not."""

    @property
    def init(self) -> Callable[[jax.Array], Any]:
        """Function of a key that returns the state just before the first frame."""


class HoldsModel(Protocol):
    """A filter, of which a function reads the model."""

    @property
    def dynamics(self) -> Any:
        """The motion model."""

    @property
    def likelihood(self) -> Any:
        """The observation model."""

    @property
    def initial(self) -> Any:
        """Substates before the first frame, or a sampler of them."""


class Differentiable(HoldsModel, Protocol):
    """A filter with strategies for gradients, see ``jaxpf.gradients``."""

    @property
    def gradient(self) -> Any:
        """The strategy for resampling."""

    @property
    def motion_gradient(self) -> str:
        """The name of the strategy for the motion."""


class _Moves(Protocol):
    @property
    def propagate(self) -> Callable[..., jax.Array]: ...


class _MovesAll(Protocol):
    @property
    def propagate_all(self) -> Callable[..., jax.Array]: ...


class _Observes(Protocol):
    @property
    def observe(self) -> Callable[[Any], Any]: ...


class _Weighs(_Observes, Protocol):
    @property
    def log_prob(self) -> Callable[..., jax.Array]: ...


class _WeighsAll(_Observes, Protocol):
    @property
    def log_prob_all(self) -> Callable[..., jax.Array]: ...


class _Proposes(Protocol):
    @property
    def propose(self) -> Callable[..., jax.Array]: ...


class _ProposesAll(Protocol):
    @property
    def propose_all(self) -> Callable[..., jax.Array]: ...


DynamicsLike = _Moves | _MovesAll
LikelihoodLike = _Weighs | _WeighsAll
ProposalLike = _Proposes | _ProposesAll
