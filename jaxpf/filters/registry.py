"""How guesses are organised: one folder or file per filter, and resampling, which they share.

To add a filter, write a ``Filter`` and enter it in ``_FILTERS``.
"""

import importlib
from typing import TYPE_CHECKING

from jaxpf.contract.errors import InputError

if TYPE_CHECKING:
    from jaxpf.filters.filter import Filter

#: Name -> where its ``Filter`` stands.
_FILTERS = {
    "partitioned": "jaxpf.filters.partitioned.options:PARTITIONED",
    "factored": "jaxpf.filters.factored.options:FACTORED",
    "labelled": "jaxpf.filters.labelled.options:LABELLED",
}


def all_filters() -> "dict[str, Filter]":
    """All filters, by name."""
    found = {}
    for name, place in _FILTERS.items():
        module, _, attribute = place.partition(":")
        found[name] = getattr(importlib.import_module(module), attribute)
    return found


def methods() -> tuple[str, ...]:
    """The methods of all filters."""
    return tuple(method for one in all_filters().values() for method in one.methods)


def filter_of(method: str) -> "Filter":
    """The filter that a method belongs to.

    Raises:
        InputError: no filter has it.
    """
    for one in all_filters().values():
        if method in one.methods:
            return one
    raise InputError(f"method {method!r} is unknown; choose one of {', '.join(methods())}.")
