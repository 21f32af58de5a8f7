"""Checks of a labelled tracker at construction."""

from collections.abc import Sequence

import numpy as np

from jaxpf.contract.calls import check_factors
from jaxpf.contract.errors import Argument, InputError, check_known
from jaxpf.contract.numbers import check_number
from jaxpf.contract.options import check_fields
from jaxpf.contract.refusals import refused
from jaxpf.contract.state import Summary
from jaxpf.filters.initial import check_rows
from jaxpf.filters.labelled.settings import Settings
from jaxpf.filters.noiseless import noiseless, without_noise
from jaxpf.gradients import check_gradients


def check_tracker(tracker: Settings) -> None:
    """Refuse settings that cannot work or would be silently wrong."""
    check_fields(tracker)
    check_known("population=", tracker.population, ("fixed", "open"))
    gradient = tracker.gradient
    if gradient.blends or not gradient.equalises:
        raise InputError(
            f"gradient {type(gradient).__name__} needs particles that hold all targets; "
            "use NoGradient() or StopGradient() of jaxpf.gradients."
        )
    check_gradients(tracker)
    _check_targets(tracker)
    if tracker.population == "open":
        _check_open(tracker)
    _check_coordinates(tracker)
    if tracker.regularise is not None:
        check_number("regularise", tracker.regularise, above=0, most=1)
    check_rows(tracker.dynamics, tracker.num_targets)
    check_factors(tracker.dynamics, tracker.likelihood, "labelled particles")
    if tracker.motion_gradient == "score" and tracker.feedback != "none":
        raise InputError(
            "motion_gradient='score' needs the density of a move, and feedback='estimate' changes "
            "the move; use feedback='none' or motion_gradient='pathwise'."
        )
    if tracker.motion_gradient == "score":
        refused(without_noise("motion_gradient='score'", tracker, noiseless(tracker).moved))


def _check_targets(tracker: Settings) -> None:
    num_targets = tracker.num_targets
    if num_targets is None or num_targets < 1:
        raise InputError(
            f"num_targets={num_targets} must be the number of targets that the initial sampler "
            "draws, at least 1."
        )
    if tracker.num_particles < num_targets:
        raise InputError(
            Argument("num_particles", tracker.num_particles),
            f" is fewer than the {num_targets} targets that share them; use at least one particle "
            "per target, better some fifty.",
        )


def _check_open(tracker: Settings) -> None:
    if callable(tracker.initial):
        raise InputError(
            "population='open' starts from an array [L, D] whose rows of NaN are empty slots, not "
            "from a sampler; give initial as an array."
        )
    if tracker.weights != "equal_share":
        raise InputError(
            f"population='open' gives every new target an equal share, which "
            f"weights={tracker.weights!r} does not; use weights='equal_share'."
        )


def _check_coordinates(tracker: Settings) -> None:
    position, speed = tracker.position, tracker.speed
    if tracker.feedback == "none" and tracker.regularise is None and speed is None:
        return  # unused
    if speed is not None and len(speed) != len(position):
        raise InputError(
            f"speed={list(speed)} has {len(speed)} coordinates and position={list(position)} has "
            f"{len(position)}; name one speed for each position."
        )
    used = [*position, *(speed or ())]
    dimension = np.inf if callable(tracker.initial) else np.shape(tracker.initial)[1]
    if len(set(used)) != len(used) or min(used, default=0) < 0 or max(used, default=0) >= dimension:
        last = "" if np.isinf(dimension) else f" to {dimension - 1}"
        raise InputError(
            f"position={list(position)} and speed={speed and list(speed)} must name different "
            f"coordinates of a substate, counted from 0{last}."
        )


def check_started(summary: Summary, ids: Sequence[object] | np.ndarray | None = None) -> None:
    """Refuse the summary of a first frame in which a target has no weight.

    ``ids`` are the targets' names; default their numbers.
    """
    lost = np.flatnonzero(np.asarray(summary.without_likelihood)).tolist()
    if lost:
        names = ", ".join(str(number if ids is None else ids[number]) for number in lost)
        raise InputError(
            f"in the first frame every particle of target {names} has likelihood zero; check its "
            "box, or widen the noise of position and size."
        )
