"""Optional methods and attributes of what users write: the one place where they are looked up."""

from typing import Any

#: Their names, and what a part without one counts as having; None for methods.  For their meaning
#: see ``jaxpf.contract.interface``.
OPTIONAL: dict[str, Any] = {
    # of trackers
    "evidence_biases": (),
    "moments": None,
    "num_partitions": None,
    "states": None,
    # of trackers and likelihoods
    "observe_nearby": None,
    # of dynamics and likelihoods
    "at_frame": None,
    "with_inputs": None,
    # of dynamics
    "by_partition": (),
    "coupled": False,
    "log_density": None,
    "log_density_all": None,
    "log_label": None,
    "predict": None,
    "predict_all": None,
    "propagate_label": None,
    # of likelihoods
    "as_seen": None,
    "fixed_observation": False,
    "form": None,
    "handles_nan": False,
    "log_first_stage": None,
    "log_joint": None,
    "log_joint_all": None,
    "log_joint_labelled": None,
    "log_joint_labelled_all": None,
    "log_odds": None,
    "log_odds_all": None,
    "look_near": None,
    "model_error": (0.0, 0.0, 0.0),
    "orders_of_labels": None,
    "reaches_border": None,
    "same_place": None,
    "sample": None,
    "space": None,
    "state_gradient": True,
    # of proposals
    "needs_noise": False,
    "of_model": None,
    # of observations
    "take_frame": None,
    # of initial samplers
    "independent": False,
}


def optional(part: object, name: str) -> Any:
    """An optional method or attribute of a part; if it has none, the default in ``OPTIONAL``."""
    return getattr(part, name, OPTIONAL[name])


def unwrapped(tracker: Any, having: str = "likelihood") -> Any:
    """The outermost of a tracker and those that it wraps with an attribute, else the innermost."""
    while not hasattr(tracker, having) and hasattr(tracker, "tracker"):
        tracker = tracker.tracker
    return tracker


def likelihood_of(tracker: Any) -> Any:
    """The likelihood of a tracker or of the filter that it wraps; None if there is none."""
    return getattr(unwrapped(tracker), "likelihood", None)
