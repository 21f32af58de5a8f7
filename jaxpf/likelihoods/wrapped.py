"""A wrapper around a likelihood that translates substates into the form it expects."""

from typing import Any

import jax

from jaxpf import contract
from jaxpf.contract import Likelihood


def _forwarded(name: str) -> Any:
    """An attribute of the inner likelihood, or else its default; only if one of them defines it."""

    def get(self):
        offers = hasattr(self.likelihood, name)
        return getattr(self.likelihood if offers else Likelihood, name)

    return property(get)


def _joint(name: str) -> Any:
    """A joint likelihood of translated substates; only if the inner likelihood defines it."""

    def get(self):
        inner = getattr(self.likelihood, name)
        return lambda observation, substates, *rest: inner(
            observation, self.translated(substates.T).T, *rest
        )

    return property(get)


def _near(self):
    """``look_near`` with translated estimates; only if the inner likelihood defines it."""
    inner = self.likelihood.look_near
    return lambda observation, estimates: inner(observation, self.translated(estimates.T).T)


def _odds(name: str) -> Any:
    """Log odds of translated substates; only if the inner likelihood defines them."""

    def get(self):
        inner = getattr(self.likelihood, name)
        return lambda observation, partition, substates: inner(
            observation, partition, self.translated(substates)
        )

    return property(get)


class WrappedLikelihood(Likelihood):
    """Another likelihood, applied to translated substates, with the same capabilities.

    A wrapper is a pytree dataclass with a field ``likelihood``; it overrides ``translated``.
    """

    likelihood: Any

    def translated(self, substates: jax.Array) -> jax.Array:
        """Substates ``[D, ...]`` in the form of the inner likelihood, ``[D', ...]``."""
        return substates

    state_gradient = _forwarded("state_gradient")
    fixed_observation = _forwarded("fixed_observation")
    form = _forwarded("form")

    def observe(self, frame):
        """The inner likelihood's observation of a frame."""
        return self.likelihood.observe(frame)

    def log_prob(self, observation, partition, substate):
        """The inner log-likelihood ``[]`` of one substate ``[D]``."""
        inner = contract.method_of(self.likelihood, Likelihood, "log_prob")
        return inner(observation, partition, self.translated(substate))

    def log_prob_all(self, observation, partition, substates):
        """The inner log-likelihoods ``[N]`` of substates ``[D, N]``."""
        return contract.log_prob_all(
            self.likelihood, observation, partition, self.translated(substates)
        )

    log_joint = _joint("log_joint")
    log_joint_labelled = _joint("log_joint_labelled")

    look_near = property(_near)
    log_odds = _odds("log_odds")
    log_odds_all = _odds("log_odds_all")
