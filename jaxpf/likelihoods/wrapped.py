"""A likelihood around another one, for substates that the inner one knows in another form."""

from typing import Any

import jax

from jaxpf import contract
from jaxpf.contract import Likelihood


def _forwarded(name: str) -> Any:
    """That of the inner likelihood, or the default; absent where there is neither."""

    def get(self):
        offers = hasattr(self.likelihood, name)
        return getattr(self.likelihood if offers else Likelihood, name)

    return property(get)


def _joint(name: str) -> Any:
    """A joint likelihood of translated substates; absent where there is none inside."""

    def get(self):
        inner = getattr(self.likelihood, name)
        return lambda observation, substates, *rest: inner(
            observation, self.translated(substates.T).T, *rest
        )

    return property(get)


def _odds(name: str) -> Any:
    """Log odds of translated substates; absent where there are none inside."""

    def get(self):
        inner = getattr(self.likelihood, name)
        return lambda observation, partition, substates: inner(
            observation, partition, self.translated(substates)
        )

    return property(get)


class WrappedLikelihood(Likelihood):
    """Another likelihood, of translated substates; it can do what that one can, and no more.

    A wrapper is a pytree dataclass with a field ``likelihood`` that defines ``translated``.
    """

    likelihood: Any

    def translated(self, substates: jax.Array) -> jax.Array:
        """Substates ``[D, ...]`` as the inner likelihood knows them, ``[D', ...]``."""
        return substates

    state_gradient = _forwarded("state_gradient")
    fixed_observation = _forwarded("fixed_observation")
    form = _forwarded("form")
    estimated_nanoseconds = _forwarded("estimated_nanoseconds")

    def observe(self, frame):
        """What the inner likelihood needs of a frame."""
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

    log_odds = _odds("log_odds")
    log_odds_all = _odds("log_odds_all")
