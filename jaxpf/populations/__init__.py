"""Objects that come and go, by detections."""

from jaxpf.populations.following import (
    TrackedPopulation,
    follow,
    open_box_model,
    open_box_tracker,
    open_model,
)
from jaxpf.populations.lifetimes import (
    EMPTY,
    Birth,
    Changes,
    Death,
    Living,
    Refusal,
    Rules,
    advance,
    nobody,
)

__all__ = [
    "EMPTY",
    "Birth",
    "Changes",
    "Death",
    "Living",
    "Refusal",
    "Rules",
    "TrackedPopulation",
    "advance",
    "follow",
    "nobody",
    "open_box_model",
    "open_box_tracker",
    "open_model",
]
