"""Wrappers: what one does not define itself is that of the likelihood or tracker inside."""

import functools
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp

from jaxpf.contract.calls import changed_inside, log_prob_all, observed_apart
from jaxpf.contract.interface import Likelihood, Tracker

#: Optional methods of a likelihood that take substates or estimates: their place among the
#: arguments, and the axis of coordinates, 0 in ``[D, N]`` and 1 in ``[P, D]`` and ``[P, D, N]``.
SUBSTATES = {
    "log_first_stage": (1, 1),
    "log_joint": (1, 1),
    "log_joint_all": (1, 1),
    "log_joint_labelled": (1, 1),
    "log_joint_labelled_all": (1, 1),
    "log_odds": (2, 0),
    "log_odds_all": (2, 0),
    "look_near": (1, 1),
    "observe_nearby": (1, 1),
    "reaches_border": (1, 0),
    "same_place": (1, 0),
    "sample": (1, 1),
}


def offered(wrapper: Any, field: str, name: str) -> Any:
    """What the part in a wrapper's field offers; a part that this returns is wrapped again.

    For ``__getattr__``, which Python calls for what the wrapper itself does not define.
    """
    if name.startswith("__") or name == field:  # the field may be missing while it is copied
        raise AttributeError(name)
    inner = getattr(getattr(wrapper, field), name)
    if name not in ("at_frame", "with_inputs"):
        return inner
    return lambda *given: changed_inside(wrapper, field, lambda _: inner(*given))


class WrappedLikelihood(Likelihood):
    """Another likelihood, applied to translated substates, with everything that it offers.

    A wrapper is a pytree dataclass with a field ``likelihood``.  It overrides ``translated``, or
    ``passed_on`` to change more than the substates.
    """

    likelihood: Any

    def translated(self, substates: jax.Array) -> jax.Array:
        """Substates ``[D, ...]`` in the form of the inner likelihood, ``[D', ...]``."""
        return substates

    def passed_on(self, name: str, method: Callable, *arguments: Any, **named: Any) -> Any:
        """Call an optional method of the inner likelihood, with translated substates."""
        place, axis = SUBSTATES[name]
        substates = jnp.moveaxis(arguments[place], axis, 0)
        translated = jnp.moveaxis(self.translated(substates), 0, axis)
        return method(*arguments[:place], translated, *arguments[place + 1 :], **named)

    def __getattr__(self, name: str) -> Any:
        """What the inner likelihood offers beyond the methods below."""
        inner = offered(self, "likelihood", name)
        if name not in SUBSTATES:
            return inner
        # With the signature of the inner method, which ``missing_frames`` reads.
        return functools.update_wrapper(functools.partial(self.passed_on, name, inner), inner)

    def observe(self, frame):
        """The inner likelihood's observation of a frame."""
        return self.likelihood.observe(frame)

    def log_prob_all(self, observation, partition, substates):
        """The inner log-likelihoods ``[N]`` of substates ``[D, N]``."""
        return log_prob_all(self.likelihood, observation, partition, self.translated(substates))


class WrappedTracker(Tracker):
    """Another tracker, whose model ``jaxpf.contract.calls.unwrapped`` finds inside.

    A wrapper is a pytree dataclass with a field ``tracker``; it defines ``step_observed``.
    """

    tracker: Any

    @property
    def num_partitions(self) -> int:
        """Number of partitions of the tracker, P."""
        return self.tracker.num_partitions

    def init(self, key: jax.Array) -> Any:
        """Return the tracker's initial state."""
        return self.tracker.init(key)

    def observe(self, frame: Any) -> Any:
        """Return what the tracker needs of a frame."""
        return observed_apart(self.tracker)[0](frame)
