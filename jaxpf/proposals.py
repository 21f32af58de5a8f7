"""Proposals: substates drawn given the frame, for ``jaxpf.Partitioned(proposal=...)``.

The dynamics ignore the frame: if observations are precise, few of their draws fit.  A proposal
uses the frame, and a stage's weight is likelihood times transition density over proposal density,
so the evidence stays unbiased::

    jaxpf.Partitioned(..., proposal=jaxpf.proposals.Mixture(jaxpf.proposals.LocallyOptimal()))

To write a proposal, see ``jaxpf.contract.Proposal``.  Partitions that are missing in a frame move
by the dynamics.
"""

import math
from collections.abc import Callable
from types import FunctionType
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from jaxpf import contract
from jaxpf.contract import Proposal, calls
from jaxpf.contract.calls import of_partition
from jaxpf.contract.numbers import check_number
from jaxpf.contract.pytree import pytree_dataclass
from jaxpf.contract.wrapped import offered


class WrappedProposal(Proposal):
    """A proposal around another one, in its field ``proposal``."""

    def __getattr__(self, name: str) -> Any:
        """What the other proposal offers beyond the methods of this one."""
        return offered(self, "proposal", name)


@pytree_dataclass
class Mixture(WrappedProposal):
    """A mixture of another proposal and the dynamics, weighted by the density of the mixture.

    Weights are at most the likelihood over ``1 - share`` for any other proposal (deterministic
    mixture; Owen & Zhou 2000).

    Attributes:
        proposal: the other proposal.
        share: probability of drawing from ``proposal``, at least 0 and below 1.
        dynamics: filled in by the filter.
    """

    proposal: Any
    share: Any = 0.9
    dynamics: Any = None

    def __post_init__(self):
        check_number("share", self.share, least=0, below=1)

    def of_model(self, dynamics, likelihood):
        """See ``jaxpf.contract.Proposal``."""
        return Mixture(calls.proposal_of(self.proposal, dynamics, likelihood), self.share, dynamics)

    def propose_all(self, key, observation, partition, current, previous, parent):
        """Draw substates ``[D, N]``, each from the other proposal or from the dynamics."""
        proposal_key, dynamics_key, choice_key = jax.random.split(key, 3)
        past = partition, current, previous, parent
        proposed = calls.propose_all(self.proposal, proposal_key, observation, *past)
        moved = contract.propagate_all(self.dynamics, dynamics_key, *past)
        is_proposed = jax.random.uniform(choice_key, partition.shape) < self.share
        return jnp.where(is_proposed, proposed, moved)

    def log_density_all(self, observation, partition, new, current, previous, parent):
        """Log of the mixture's density, ``[N]``."""
        move = partition, new, current, previous, parent
        share = jnp.asarray(self.share, new.dtype)
        return jnp.logaddexp(
            jnp.log(share) + calls.proposal_log_density_all(self.proposal, observation, *move),
            jnp.log1p(-share) + contract.log_density_all(self.dynamics, *move),
        )


class _Normal(Proposal):
    """A normal density for each particle, given by ``_moments``; its parameters are constants.

    It moves every coordinate, so that each must have noise.

    Derivatives of the evidence therefore flow only through the transition density and the
    likelihood, which is exact, and not through the proposal's mean and covariance.
    """

    needs_noise = True

    def propose_all(self, key, observation, partition, current, previous, parent):
        """Draw normal substates, ``[D, N]``."""
        mean, root, index = self._at(observation, partition, current, previous, parent)
        noise = jax.random.normal(key, current.shape, current.dtype)
        # With the precision C C^T, C^-T is a root of the covariance.
        return mean + _times(jnp.swapaxes(jnp.linalg.inv(root), 1, 2), index, noise)

    def log_density_all(self, observation, partition, new, current, previous, parent):
        """Normal log-densities, ``[N]``."""
        mean, root, index = self._at(observation, partition, current, previous, parent)
        residual = _times(jnp.swapaxes(root, 1, 2), index, new - mean)
        volume = jnp.sum(jnp.log(jnp.diagonal(root, axis1=1, axis2=2)), axis=1)
        constant = 0.5 * new.shape[0] * math.log(2 * math.pi)
        return -0.5 * jnp.sum(residual**2, axis=0) + of_partition(volume, index) - constant

    def _at(self, observation, *past) -> tuple[jax.Array, jax.Array, jax.Array]:
        return lax.stop_gradient(self._moments(observation, *past))

    def _moments(self, observation, partition, current, previous, parent):
        """Means ``[D, N]``, roots C ``[K, D, D]`` of precisions, and each particle's row in C."""
        raise NotImplementedError


@pytree_dataclass
class LocallyOptimal(_Normal):
    """``p(x_t | x_{t-1}, y_t)`` for linear-Gaussian dynamics and ``jaxpf.likelihoods.Gaussian``.

    A stage's weight is ``p(y_t | x_{t-1})``, independent of the particle's new substate (Doucet,
    Godsill & Andrieu 2000, section II.D).  The dynamics' noise must have full rank.

    Attributes:
        dynamics: filled in by the filter.
        likelihood: filled in by the filter.
    """

    dynamics: Any = None
    likelihood: Any = None

    def of_model(self, dynamics, likelihood):
        """See ``jaxpf.contract.Proposal``."""
        return LocallyOptimal(dynamics, likelihood)

    def _moments(self, observation, partition, current, previous, parent):
        count = np.shape(self.likelihood.noise)[0]
        partitions, zeros = jnp.arange(count), jnp.zeros((current.shape[0], count), current.dtype)
        transition = _transition(self.dynamics, partitions, zeros, zeros, zeros)
        evidence = _evidence(self.likelihood, observation, partitions)
        precision = _of_full_rank(_curvature(transition, zeros)) + _curvature(evidence, zeros)
        slope = _slope(_transition(self.dynamics, partition, current, previous, parent), current)
        slope += _slope(_evidence(self.likelihood, observation, partition), current)
        return (
            current + _solve(precision, partition, slope),
            jnp.linalg.cholesky(precision),
            partition,
        )


@pytree_dataclass
class Linearised(_Normal):
    """A normal density from an observation linearised at the predicted substate, as in an EKF.

    Source: Doucet, Godsill & Andrieu 2000, section II.D.  For a linear observation with normal
    noise this is ``LocallyOptimal``.  The dynamics' noise must be normal and have full rank.  Use
    it within a ``Mixture`` if the linearisation may be poor.

    Attributes:
        residual: ``(observation, partition [], substate [D]) -> [E]``, the observation minus its
            prediction from the substate, in units of its noise (whitened).
        dynamics: filled in by the filter.
    """

    residual: Any
    dynamics: Any = None

    def __post_init__(self):
        if isinstance(self.residual, FunctionType):
            object.__setattr__(self, "residual", jax.tree_util.Partial(self.residual))

    def of_model(self, dynamics, likelihood):
        """See ``jaxpf.contract.Proposal``."""
        return Linearised(self.residual, dynamics)

    def _moments(self, observation, partition, current, previous, parent):
        index = jnp.arange(current.shape[1])
        transition = _transition(self.dynamics, partition, current, previous, parent)
        precision = _of_full_rank(_curvature(transition, current))
        expected = current + _solve(precision, index, _slope(transition, current))
        # Axes: the residual [N, E] and its derivative [N, E, D].
        seen = observation, partition, expected
        residual = jax.vmap(self.residual, in_axes=(None, 0, 1))(*seen)
        slope = jax.vmap(jax.jacfwd(self.residual, argnums=2), in_axes=(None, 0, 1))(*seen)
        precision = precision + jnp.swapaxes(slope, 1, 2) @ slope
        step = _solve(precision, index, jnp.einsum("ned,ne->dn", slope, residual))
        return expected - step, jnp.linalg.cholesky(precision), index


def _transition(dynamics, partition, current, previous, parent) -> Callable:
    """Transition log-density ``[N]`` as a function of the new substates ``[D, N]``."""
    past = current, previous, parent
    return lambda new: contract.log_density_all(dynamics, partition, new, *past)


def _evidence(likelihood, observation, partition) -> Callable:
    """Log-likelihood ``[N]`` as a function of the substates ``[D, N]``."""
    return lambda new: contract.log_prob_all(likelihood, observation, partition, new)


def _slope(log_density: Callable, places: jax.Array) -> jax.Array:
    """Gradients ``[D, N]`` at ``places`` ``[D, N]``; 0 where not finite."""
    slope = jax.grad(lambda x: jnp.sum(log_density(x)))(places)
    return jnp.where(jnp.isfinite(slope), slope, 0.0)


def _curvature(log_density: Callable, places: jax.Array) -> jax.Array:
    """Negative second derivatives ``[N, D, D]`` at ``places`` ``[D, N]``; 0 where not finite."""
    gradient = jax.grad(lambda x: jnp.sum(log_density(x)))

    def along(direction):
        return jax.jvp(gradient, (places,), (jnp.broadcast_to(direction[:, None], places.shape),))[
            1
        ]

    second = -jax.vmap(along)(jnp.eye(places.shape[0], dtype=places.dtype))  # [D, D, N]
    return jnp.moveaxis(jnp.where(jnp.isfinite(second), second, 0.0), -1, 0)


def _of_full_rank(precision: jax.Array) -> jax.Array:
    """The transition's precisions ``[K, D, D]``, NaN where a coordinate has no noise.

    Such a coordinate cannot move, and a density that leaves it out would not weigh its moves.
    """
    has_noise = jnp.all(jnp.diagonal(precision, axis1=1, axis2=2) > 0, axis=1)
    return jnp.where(has_noise[:, None, None], precision, jnp.nan)


def _solve(precision: jax.Array, index: jax.Array, vectors: jax.Array) -> jax.Array:
    """Inverse of each particle's row of ``precision`` ``[K, D, D]``, times ``vectors``."""
    return _times(jnp.linalg.inv(precision), index, vectors)


def _times(matrices: jax.Array, index: jax.Array, vectors: jax.Array) -> jax.Array:
    """Each particle's row of ``matrices`` ``[K, D, D]``, times ``vectors`` ``[D, N]``."""
    return jnp.sum(of_partition(matrices, index) * vectors.T[:, None, :], axis=-1).T
