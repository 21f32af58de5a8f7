"""Trackers put together: a filter on a target's model, with the defaults of the command line.

Neither filters nor targets know each other; here they meet.  The command line, evaluations, tuning
and the public factories (``jaxpf.boxes.tracker`` and the like) all build their trackers here.
"""

import dataclasses
import difflib
from collections.abc import Mapping
from typing import Any

import numpy as np

from jaxpf import filters
from jaxpf.contract.errors import InputError
from jaxpf.contract.options import implied, options_of
from jaxpf.filters.filter import Filter
from jaxpf.targets.target import Looks, Start, Target

#: Where a method has a number of its own, by which histograms choose their way.
_PARTICLES = 300


def filter_for(target: Target, method: str | None = None) -> Filter:
    """The filter of a method, or that which tracks such a target by default.

    Raises:
        InputError: no filter has it.
    """
    method = method or target.defaults.get("method")
    return filters.filter_of(method) if method else next(iter(filters.all_filters().values()))


def filled(owner: type, given: Mapping[str, Any], defaults: Mapping[str, Any] | None = None) -> Any:
    """An instance of a class of options, from those of the values that are its own.

    Args:
        owner: of the options.
        given: name -> value; they also say what they imply of options that were left open.
        defaults: where they are not the owner's.

    Raises:
        InputError: values that are out of range, or do not go with each other.
    """
    known = options_of(owner)
    found = {**(defaults or {}), **given}
    found |= implied(owner, {name: [value] for name, value in given.items() if name in known})
    return owner(**{name: value for name, value in found.items() if name in known})


def build(target: Target, model: Any, its: Filter, options: Any, start: Start, looks: Looks) -> Any:
    """The tracker of a filter on a target's model.

    Args:
        target: what is tracked.
        model: its options.
        its: the filter.
        options: the filter's.
        start: where tracking starts.
        looks: from what likelihoods are learned.

    Raises:
        InputError: options that do not go with each other; what cannot be seen.
    """
    its.check(options, start.parents)
    model = target.resolved(model, looks.is_filmed)
    likelihood = target.likelihood(model, start, looks)
    return its.tracker(target.model(model, start, likelihood), options)


def looks_of_frame(frame: Any, particles: int | None, patches: Any = None) -> Looks:
    """What likelihoods are learned from: the start frame.

    Args:
        frame: uint8 RGB ``[H, W, 3]``.
        particles: None where the method has a number of its own.
        patches: see ``make``.
    """
    return Looks(
        frame=frame if patches is None else None,
        patches=patches,
        frame_shape=frame.shape[:2],
        num_particles=particles or _PARTICLES,
        typical=frame[None],
        surroundings=frame,
    )


def make(
    target: Target,
    frame: Any,
    start: Start,
    given: Mapping[str, Any],
    *,
    likelihood: Any = None,
    ordering: Any = None,
    patches: Any = None,
) -> Any:
    """What the public factories do.

    Args:
        target: what is tracked.
        frame: uint8 RGB ``[H, W, 3]``, in which it starts; None goes with one's own likelihood.
        start: where.
        given: options of the target and of the method's filter; None counts as not given.  The
            resampling may be a scheme of one's own, see ``jaxpf.resampling``.
        likelihood: the name of a way to compute it, or one of one's own.
        ordering: from ``jaxpf.ordering``, instead of a method.
        patches: P pictures, uint8 RGB ``[h, w, 3]``, upright, from which looks are learned where
            the start frame does not show them well.

    Raises:
        InputError: an option that there is not or a value out of range; the sentence says which.
    """
    values = {name: _plain(value) for name, value in given.items() if value is not None}
    if isinstance(likelihood, str):
        values["likelihood"], likelihood = likelihood, None
    if ordering is not None:
        if "method" in values:
            raise InputError("method and ordering were both given; use one of them.")
        values["method"] = "sir"
    scheme = values.get("resampling")
    if scheme is not None and not isinstance(scheme, str):
        del values["resampling"]
    its = filter_for(target, values.get("method"))
    _check_names(values, target, its)
    defaults = {**target.defaults, "method": values.get("method", target.defaults.get("method"))}
    if defaults["method"] is None:
        del defaults["method"]
    options = filled(its.options, values, defaults)
    model = target.resolved(filled(target.options, values), is_filmed=True)
    if likelihood is None:
        frame = _checked(frame)
        looks = looks_of_frame(frame, options.particles, patches)
        made = build(target, model, its, options, start, looks)
    else:
        its.check(options, start.parents)
        made = its.tracker(target.model(model, start, likelihood), options)
    own = {"ordering": ordering, "resampling": None if isinstance(scheme, str) else scheme}
    own = {name: value for name, value in own.items() if value is not None}
    return dataclasses.replace(made, **own) if own else made


def _check_names(values: Mapping[str, Any], target: Target, its: Filter) -> None:
    known = [*options_of(target.options, its.options), "likelihood", "ordering", "patches"]
    for name in values:
        if name not in known:
            near = difflib.get_close_matches(name, known, n=3, cutoff=0.5)
            others = (
                f"did you mean {' or '.join(near)}?" if near else f"there are {', '.join(known)}."
            )
            raise InputError(
                f"there is no option {name!r} of {target.name} with the method "
                f"{values.get('method') or target.defaults.get('method', 'dps')}; {others}"
            )


def _checked(frame: Any) -> np.ndarray:
    """The start frame."""
    frame = np.asarray(frame)
    if frame.ndim != 3 or frame.shape[2] != 3 or frame.dtype != np.uint8:
        raise InputError(
            f"frame is {frame.dtype} {list(frame.shape)}; give the frame in which tracking starts, "
            "uint8 RGB [H, W, 3], or a likelihood of your own."
        )
    return frame


def _plain(value: Any) -> Any:
    """Arrays as the options have them: numbers and tuples."""
    return value.tolist() if hasattr(value, "tolist") else value
