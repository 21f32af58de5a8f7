"""Optional methods and attributes of what users write: the one place where they are looked up."""

from typing import Any

#: What a part without one counts as having, see ``jaxpf.contract.interface``; None for the others.
DEFAULTS: dict[str, Any] = {
    "by_partition": (),
    "coupled": False,
    "evidence_biases": (),
    "fixed_observation": False,
    "handles_nan": False,
    "independent": False,
    "model_error": (0.0, 0.0, 0.0),
    "needs_noise": False,
    "state_gradient": True,
}


def optional(part: object, name: str) -> Any:
    """An optional method or attribute of a part; if it has none, the one in ``DEFAULTS``."""
    return getattr(part, name, DEFAULTS.get(name))


def unwrapped(tracker: Any, having: str = "likelihood") -> Any:
    """The outermost of a tracker and those that it wraps with an attribute, else the innermost."""
    while not hasattr(tracker, having) and hasattr(tracker, "tracker"):
        tracker = tracker.tracker
    return tracker


def likelihood_of(tracker: Any) -> Any:
    """The likelihood of a tracker or of the filter that it wraps; None if there is none."""
    return getattr(unwrapped(tracker), "likelihood", None)
