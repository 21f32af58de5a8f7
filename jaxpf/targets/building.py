"""Completes and checks the options of the public factories, such as ``jaxpf.boxes.tracker``.

The command line, evaluation and tuning check options themselves, and call ``build``.
"""

import dataclasses
import functools
import inspect
import os
from collections.abc import Callable, Iterable, Mapping
from typing import Annotated, Any, ParamSpec, TypeVar

import numpy as np
from jax.typing import ArrayLike

from jaxpf import filters
from jaxpf.contract.errors import InputError
from jaxpf.contract.options import Option, complete, defaults_of, options_of
from jaxpf.contract.types import TrackerLike
from jaxpf.filters.options import FilterOptions
from jaxpf.filters.registry import Filter, all_filters
from jaxpf.ordering import Ordering
from jaxpf.targets.presets import PRESETS
from jaxpf.targets.registry import find_target
from jaxpf.targets.target import Looks, Start, Target
from scenes import Scene

P = ParamSpec("P")
R = TypeVar("R")


class TrackerOptions(FilterOptions, total=False):
    """What every factory takes besides its own options: a system, a method, its filter's options.

    ``ordering`` is one from ``jaxpf.ordering``, instead of a method.
    """

    like: str | None
    method: str | None
    num_particles: int | None
    ordering: Ordering | None


#: An option of boxes and of points.
Network = Annotated[
    str | None,
    Option(
        "File with the weights of EfficientNet-lite0, .pth or .npz; by default those of "
        "'jaxpf[pretrained]' (pretrained appearance only).",
        needs=("appearance", "pretrained"),
        rare=True,
    ),
]


def filter_for(target: Target, method: str | None = None) -> Filter:
    """The filter of a method; by default the target's default filter.

    Raises:
        InputError: no filter has this method.
    """
    return filters.filter_of(method or target.defaults.get("method", "dps"))


def defaults_for(target: Target, filter_: Filter) -> Mapping[str, Any]:
    """Defaults of a filter's options that a target overrides: only those of its default filter."""
    return target.defaults if filter_ is filter_for(target) else {}


def check_names(given: Iterable[str], target: Target, filter_: Filter) -> None:
    """Refuse names that are options neither of a target nor of a filter.

    Raises:
        InputError: lists those that there are.
    """
    names = options_of(target.tracker, filter_.build)
    for name in given:
        if name not in names:
            raise InputError(
                f"there is no option {name!r} of {target.name} or of the {filter_.name} filter; "
                f"there are {', '.join(names)}."
            )


def build(
    target: Target, values: Mapping[str, Any], start: Start, looks: Any, **objects: Any
) -> Any:
    """The tracker of checked values.

    Args:
        target: the kind of target.
        values: of options of the target and of a filter, with its ``method``; the rest have their
            defaults.
        start: where tracking starts.
        looks: what the likelihood is learned from.
        objects: of the user's, in the place of options.

    Raises:
        InputError: options conflict, or an object cannot be seen.
    """
    filter_ = filter_for(target, values.get("method"))
    filter_.check_model({**defaults_of(filter_.build), **values}, start.parents)
    settings = getattr(looks, "settings", {})
    settled = target.settle({**defaults_of(target.tracker), **values}, settings)
    return inspect.unwrap(target.tracker)(looks, start, **settled | objects)


def shapes_of(
    tracker: TrackerLike, target: Target, start: Start, estimate: ArrayLike
) -> np.ndarray:
    """Convert estimates to shapes ``[..., P, S]``, by the tracker if it can, else by the target."""
    if target.is_told_boxes_by(tracker):
        return np.asarray(tracker.boxes(estimate))  # type: ignore[attr-defined]
    return target.shapes(start, np.asarray(estimate), tracker)


def looks_of(frame: Any, num_particles: int | None = None, patches: Any = None) -> Looks:
    """What a likelihood is learned from.

    Args:
        frame: the start frame, uint8 RGB ``[H, W, 3]``; or ``Looks``, which are returned.
        num_particles: number of particles; None if the filter sets its own.
        patches: see ``Looks``.
    """
    if isinstance(frame, Looks):
        return frame
    wanted = "the frame in which tracking starts, uint8 RGB [H, W, 3], or a likelihood of your own"
    frame = np.asarray(frame)
    if frame.ndim != 3 or frame.shape[2] != 3 or frame.dtype != np.uint8:
        raise InputError(f"frame is {frame.dtype} {list(frame.shape)}; give {wanted}.")
    return Looks(frame, patches, num_particles or Looks._field_defaults["num_particles"])


def looks_of_scene(scene: Scene, num_particles: int | None, **about: Any) -> Looks:
    """A scene's reference patches and first frame; ``about`` are further fields of ``Looks``."""
    looks = Looks(scene.frames[0], scene.patches, settings=scene.settings, **about)
    return looks._replace(num_particles=num_particles) if num_particles else looks


def factory(name: str) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Decorate the factory of a kind of target, which gets a ``Start`` and every option.

    An option is what the caller gives, what another given one implies, that of a paper's system
    (``like``, see ``jaxpf.targets.presets``), or the default, for which None stands.

    Args:
        name: of the kind of target.
    """

    def decorate(function: Callable[P, R]) -> Callable[P, R]:
        @functools.wraps(function)
        def made(*arguments: P.args, **given: P.kwargs) -> R:
            bound = inspect.signature(function).bind(*arguments, **given)
            frame, start = bound.args
            return _made(find_target(name), frame, start, bound.kwargs)

        return made

    return decorate


#: Options that may be objects of the user.
_OBJECTS = ("likelihood", "resampling", "ordering", "patches")


def _made(target: Target, frame: Any, start: Any, given: dict[str, Any]) -> Any:
    """Complete and check the options, and build the tracker."""
    start = start if isinstance(start, Start) else target.start(start)
    values = {name: value for name, value in given.items() if value is not None}
    if (like := values.pop("like", None)) in target.systems:
        return target.systems[like](frame, start.shapes, **values)
    if like is not None:
        values = _with_preset(like, target, start, values)
    fields = {field.name for field in dataclasses.fields(start)} & values.keys()
    start = dataclasses.replace(start, **{name: values.pop(name) for name in fields})
    objects = {
        name: values.pop(name)
        for name in _OBJECTS
        if name in values and not isinstance(values[name], str)
    }
    if "ordering" in objects:
        if "method" in values:
            raise InputError("method and ordering were both given; use one of them.")
        values["method"] = "sir"
    values = {name: _plain(value) for name, value in values.items()}
    filter_ = filter_for(target, values.get("method"))
    check_names(values, target, filter_)
    defaults = defaults_for(target, filter_)
    values = complete(values, filter_.build, target.tracker, defaults=defaults)
    return build(target, values, start, frame, **objects)


def _with_preset(like: str, target: Target, start: Start, given: dict[str, Any]) -> dict[str, Any]:
    """The options of a published system that go with those given, and the latter."""
    known = PRESETS.get(target.name, {})
    if like not in known:
        names = ", ".join([*known, *target.systems])
        raise InputError(
            f"like={like!r:.60} is not a published system of {target.name}; choose from {names}."
        )
    options = known[like](start)
    if given.keys() & {"method", "ordering"}:
        options = {n: value for n, value in options.items() if n not in ("method", "ordering")}
    filter_ = filter_for(target, given.get("method", options.get("method")))
    declared = options_of(target.tracker, filter_.build)
    unfit = {n for n, option in declared.items() if not option.applies(given)}
    unfit |= options_of(*(each.build for each in all_filters().values())).keys() - declared.keys()
    return {n: value for n, value in options.items() if n not in unfit} | given


def _plain(value: Any) -> Any:
    """Arrays as plain numbers and lists, paths as text."""
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    return value.tolist() if hasattr(value, "tolist") else value
