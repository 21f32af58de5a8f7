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


def _translating(name: str, place: int, in_rows: bool = False) -> Any:
    """An optional method of translated substates; only if the inner likelihood defines it.

    Args:
        name: of the method.
        place: of the substates among its arguments.
        in_rows: whether these are ``[P, D]``, else ``[D]`` or ``[D, N]``.
    """

    def get(self):
        inner = getattr(self.likelihood, name)

        def of_translated(*arguments):
            substates = arguments[place]
            moved = self.translated(substates.T).T if in_rows else self.translated(substates)
            return inner(*arguments[:place], moved, *arguments[place + 1 :])

        return of_translated

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

    log_joint = _translating("log_joint", 1, in_rows=True)
    log_joint_labelled = _translating("log_joint_labelled", 1, in_rows=True)
    look_near = _translating("look_near", 1, in_rows=True)
    log_odds = _translating("log_odds", 2)
    log_odds_all = _translating("log_odds_all", 2)
    reaches_border = _translating("reaches_border", 1)
    same_place = _translating("same_place", 1)
