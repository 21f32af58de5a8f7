"""Objects that come and go, by detections."""

from typing import TYPE_CHECKING, Any

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

if TYPE_CHECKING:
    from jaxpf.populations.following import (
        TrackedPopulation,
        follow,
        open_box_model,
        open_box_tracker,
        open_model,
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


def __getattr__(name: str) -> Any:  # who only asks for the rules, as a help text, loads no JAX
    if name in __all__:
        from jaxpf.populations import following

        return getattr(following, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
