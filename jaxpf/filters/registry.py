"""Registry of particle filters.

To add a filter, write a ``Filter`` and add it to ``_FILTERS``.
"""

import dataclasses
import importlib
from typing import TYPE_CHECKING, Any

from jaxpf.contract.errors import InputError

if TYPE_CHECKING:
    from jaxpf.contract.model import Model
    from jaxpf.filters.filter import Filter

#: Name -> address of its ``Filter``.
_FILTERS = {
    "partitioned": "jaxpf.filters.partitioned.family:PARTITIONED",
    "factored": "jaxpf.filters.factored.family:FACTORED",
    "labelled": "jaxpf.filters.labelled.family:LABELLED",
}


def all_filters() -> "dict[str, Filter]":
    """All filters, by name."""
    loaded = {}
    for name, place in _FILTERS.items():
        module, _, attribute = place.partition(":")
        loaded[name] = getattr(importlib.import_module(module), attribute)
    return loaded


def methods() -> tuple[str, ...]:
    """Names of the methods of all filters."""
    return tuple(method for filter_ in all_filters().values() for method in filter_.methods)


def filter_of(method: str) -> "Filter":
    """Return the filter that a method belongs to."""
    for filter_ in all_filters().values():
        if method in filter_.methods:
            return filter_
    raise InputError(f"method {method!r} is unknown; choose one of {', '.join(methods())}.")


def build(model: "Model", *, method: str | None = None, **options: Any) -> Any:
    """The tracker of a model by the filter of a method.

    Args:
        model: dynamics, likelihood and initial state.
        method: see ``methods``; default dps.
        options: of its filter; ``resampling`` may be a scheme of your own, and ``ordering`` one
            from ``jaxpf.ordering`` in the place of the method's.
    """
    method = method or "dps"
    filter_ = filter_of(method)
    own = {"ordering": options.pop("ordering", None)}
    if not isinstance(options.get("resampling", ""), str):
        own["resampling"] = options.pop("resampling")
    options = {name: value for name, value in options.items() if value is not None}
    tracker: Any = filter_.tracker(model, filter_.options(method=method, **options))
    own = {name: value for name, value in own.items() if value is not None}
    return dataclasses.replace(tracker, **own) if own else tracker
