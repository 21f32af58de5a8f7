"""Tuned parameters of trackers as the options that people give, and back."""

import dataclasses
from collections.abc import Mapping
from typing import Any

from jaxpf.contract.errors import InputError
from jaxpf.contract.options import Option, counting, options_of


def tuned_by_default(options: Any) -> tuple[str, ...]:
    """Tracker paths of what is tuned where nobody says what."""
    counts = counting(options)
    return tuple(
        one.path + ending
        for name, one in options_of(options).items()
        if counts[name]
        for ending in one.tuned
    )


def with_tuned(options: Any, values: Mapping[str, Any], target: str) -> Any:
    """The options with tuned values.

    Args:
        options: of a target.
        values: tracker path -> value, such as ``dynamics.scale[0]`` or, for all numbers of the
            option, ``dynamics.scale``.
        target: its name.

    Raises:
        InputError: a path that no option stands for.
    """
    known = {one.path: one for one in options_of(options).values() if one.path}
    for path, value in values.items():
        name, _, index = path.partition("[")
        one = known.get(name)
        if one is None:
            raise InputError(f"a model of {target} has no {path}; apply the result to a tracker.")
        implied = dict([one.implies] if one.implies and hasattr(options, one.implies[0]) else [])
        new = _value(one, getattr(options, one.name), index.rstrip("]"), value)
        options = dataclasses.replace(options, **{one.name: new, **implied})
    return options


def _value(one: Option, before: Any, index: str, value: Any) -> Any:
    """A tracker's value in the option's own units; the other numbers stay as they are."""
    if not one.length:
        return one.kind(value)
    numbers = list(before)
    given = {int(index): value} if index else dict(enumerate(value))
    for place, number in given.items():
        numbers[place] = float(number) / (one.factors[place] if one.factors else 1.0)
    return tuple(numbers)
