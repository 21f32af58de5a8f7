"""Build a tracker from a filter and a target's model, with the command line's defaults.

Filters and targets do not know each other.  The command line, evaluation, tuning and public
factories such as ``jaxpf.boxes.tracker`` build their trackers here.
"""

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from jaxpf import filters
from jaxpf._resembling import resembling
from jaxpf.contract.errors import InputError
from jaxpf.contract.numbers import check_array
from jaxpf.contract.options import implied, options_of
from jaxpf.filters.filter import Filter
from jaxpf.targets.target import Looks, Start, Target

if TYPE_CHECKING:
    from jaxpf.contract.model import Model
    from scenes import Scene

#: Number of particles assumed when a histogram method is chosen, if the filter sets its own.
_PARTICLES = 300


def filter_for(target: Target, method: str | None = None) -> Filter:
    """The filter of a method; by default the target's default filter.

    Raises:
        InputError: no filter has this method.
    """
    method = method or target.defaults.get("method")
    return filters.filter_of(method) if method else next(iter(filters.all_filters().values()))


def check_names(given: Iterable[str], target: Target, filter_: Filter, *others: str) -> None:
    """Refuse names that are options neither of a target nor of a filter, nor among the others.

    Raises:
        InputError: suggests the names that resemble it.
    """
    names = [*options_of(target.options, filter_.options), *others]
    for name in given:
        if name not in names:
            near = resembling(name, names, most=3, cutoff=0.5)
            remedy = (
                f"did you mean {' or '.join(near)}?" if near else f"there are {', '.join(names)}."
            )
            raise InputError(
                f"there is no option {name!r} of {target.name} or of the {filter_.name} filter; "
                f"{remedy}"
            )


def defaults_for(target: Target, filter_: Filter) -> Mapping[str, Any]:
    """Defaults of a filter's options that a target overrides: only those of its default filter."""
    return target.defaults if filter_ is filter_for(target) else {}


def filled(owner: type, given: Mapping[str, Any], defaults: Mapping[str, Any] | None = None) -> Any:
    """An instance of an options class, from those given values that it defines.

    Args:
        owner: the options class.
        given: name -> value; a value may imply others that were left open.
        defaults: defaults that override those of the class.

    Raises:
        InputError: a value is out of range, or two values conflict.
    """
    declared = options_of(owner)
    values = {**(defaults or {}), **given}
    values |= implied(owner, {name: [value] for name, value in given.items() if name in declared})
    return owner(**{name: value for name, value in values.items() if name in declared})


def build(
    target: Target, model: "Model", filter_: Filter, options: Any, start: Start, looks: Looks
) -> Any:
    """The tracker of a filter and a target.

    Args:
        target: the kind of target.
        model: options of the target.
        filter_: the filter.
        options: options of the filter.
        start: where tracking starts.
        looks: what the likelihood is learned from.

    Raises:
        InputError: options conflict, or an object cannot be seen.
    """
    filter_.check(options, start.parents)
    model = target.resolved(model, looks.settings)
    likelihood = target.likelihood(model, start, looks)
    return filter_.tracker(target.model(model, start, likelihood), options)


def looks_of_frame(
    frame: np.ndarray, num_particles: int | None, patches: Sequence[np.ndarray] | None = None
) -> Looks:
    """Learn the likelihood from the start frame, or from patches.

    Args:
        frame: uint8 RGB ``[H, W, 3]``.
        num_particles: number of particles; None if the filter sets its own.
        patches: see ``make``.
    """
    return Looks(
        frame=frame if patches is None else None,
        patches=patches,
        frame_shape=frame.shape[:2],
        num_particles=num_particles or _PARTICLES,
        typical=frame[None],
        surroundings=frame,
    )


def looks_of_scene(scene: "Scene", num_particles: int, typical: np.ndarray | None = None) -> Looks:
    """A scene's reference patches and first frame, to learn a likelihood from."""
    return Looks(
        frame=None,
        patches=scene.patches,
        frame_shape=scene.frames.shape[1:3],
        num_particles=num_particles,
        typical=typical,
        surroundings=scene.frames[0],
        settings=scene.settings,
    )


def make(
    target: Target,
    frame: object,
    start: Start,
    given: Mapping[str, Any],
    *,
    likelihood: Any = None,
    ordering: Any = None,
    patches: Any = None,
) -> Any:
    """Build the tracker of a public factory.

    Args:
        target: the kind of target.
        frame: the start frame, uint8 RGB ``[H, W, 3]``; may be None with your own likelihood.
        start: where tracking starts.
        given: options of the target and of the method's filter, and ``like``, a paper's system
            (``jaxpf.targets.presets``) from which they differ; None means the default.
            ``resampling`` may be your own scheme, see ``jaxpf.resampling``.
        likelihood: the name of a built-in likelihood, or your own likelihood.
        ordering: from ``jaxpf.ordering``, instead of a method.
        patches: P upright pictures, uint8 RGB ``[h, w, 3]``, to learn the appearance from if the
            start frame does not show it well.

    Raises:
        InputError: an option is unknown, or a value is out of range.
    """
    values = {name: _plain(value) for name, value in given.items() if value is not None}
    if (like := values.pop("like", None)) is not None:
        from jaxpf.targets.presets import preset

        published = preset(like, target.name, start)
        if ordering is None and "method" not in values:
            ordering = published.ordering
        elif ordering is not None:
            published.options.pop("method", None)
        values, start = _completed(values, published.options, target), published.start
    if isinstance(likelihood, str):
        values["likelihood"], likelihood = likelihood, None
    elif likelihood is not None and not hasattr(likelihood, "observe"):
        raise InputError(
            f"likelihood={likelihood!r:.60} must be the name of a built-in likelihood, or an "
            "object with the methods observe and log_prob."
        )
    if ordering is not None:
        if "method" in values:
            raise InputError("method and ordering were both given; use one of them.")
        values["method"] = "sir"
    scheme = values.get("resampling")
    if scheme is not None and not isinstance(scheme, str):
        del values["resampling"]
    filter_ = filter_for(target, values.get("method"))
    check_names(values, target, filter_, "likelihood", "ordering", "patches")
    options = filled(filter_.options, values, defaults_for(target, filter_))
    model = target.resolved(filled(target.options, values), {})
    if likelihood is None:
        frame = _checked(frame)
        looks = looks_of_frame(frame, options.num_particles, patches)
        tracker = build(target, model, filter_, options, start, looks)
    else:
        tracker = filter_.tracker(target.model(model, start, likelihood), options)
    own = {"ordering": ordering, "resampling": None if isinstance(scheme, str) else scheme}
    own = {name: value for name, value in own.items() if value is not None}
    return dataclasses.replace(tracker, **own) if own else tracker


def _completed(
    values: Mapping[str, Any], options: Mapping[str, Any], target: Target
) -> dict[str, Any]:
    """Values with those of a paper's options that they leave open, and with which they apply."""
    declared = options_of(target.options, filter_for(target, options.get("method")).options)

    def applies(name: str) -> bool:
        other, wanted = declared[name].implies or (name, None)
        return declared[name].applies_with(values.get(other, wanted))

    return {name: value for name, value in options.items() if applies(name)} | dict(values)


def _checked(frame: object) -> np.ndarray:
    """The start frame as an array, checked to be uint8 RGB."""
    wanted = "the frame in which tracking starts, uint8 RGB [H, W, 3], or a likelihood of your own"
    check_array("frame", frame, wanted)
    frame = np.asarray(frame)
    if frame.shape[2] != 3 or frame.dtype != np.uint8:
        raise InputError(f"frame is {frame.dtype} {list(frame.shape)}; give {wanted}.")
    return frame


def _plain(value: object) -> Any:
    """Arrays as plain numbers and lists."""
    return value.tolist() if hasattr(value, "tolist") else value
