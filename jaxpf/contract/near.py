"""What a likelihood sees near the filter's last estimates."""

from collections.abc import Callable
from typing import Any

import jax
from jax import lax

from jaxpf.contract.optional import optional


def look_near(likelihood: Any, observation: Any, estimates: Callable[[], jax.Array]) -> Any:
    """The observation, with what a likelihood sees only near the filter's last estimates.

    A likelihood may define ``look_near(observation, estimates [P, D]) -> observation``.  Filters
    call it once per frame and run, so that costly features are computed near the objects alone;
    every other method then gets its result.

    Args:
        likelihood: of the filter.
        observation: from ``observe``.
        estimates: function that returns the estimates of the previous frame, ``[P, D]``.
    """
    look = optional(likelihood, "look_near")
    return look(observation, lax.stop_gradient(estimates())) if look else observation


def observe_nearby(observer: object, frame: Any, near: Any) -> Any:
    """The observation of some parts of a frame, by a tracker or likelihood; None if it has none.

    A quicker ``observe`` for single runs in large frames, with the same results:
    ``observe_nearby(frame, near)`` of a likelihood takes estimates ``[P, D]``, that of a tracker
    its state after the previous frame.  The likelihood of a substate that the parts do not show
    is NaN, and a run repeats the step with ``observe``.
    """
    observe = optional(observer, "observe_nearby")
    return observe(frame, near) if observe else None
