"""Translate between tuned tracker parameters and command-line options."""

import dataclasses
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from jaxpf.contract.errors import InputError
from jaxpf.contract.options import Option, counting, options_of

if TYPE_CHECKING:
    from jax.typing import ArrayLike


def tuned_by_default(options: object) -> tuple[str, ...]:
    """Paths of the parameters that are tuned by default."""
    counts = counting(options)
    return tuple(
        option.path + ending
        for name, option in options_of(options).items()
        if counts[name]
        for ending in option.tuned
    )


def with_tuned(options: Any, values: "Mapping[str, ArrayLike]", target: str) -> Any:
    """Replace a target's options by tuned values.

    Args:
        options: options of the target.
        values: tracker path -> value, such as ``dynamics.scale[0]``, or ``dynamics.scale`` for all
            numbers of the option.
        target: name of the target.
    """
    by_path = {option.path: option for option in options_of(options).values() if option.path}
    for path, value in values.items():
        name, _, index = path.partition("[")
        option = by_path.get(name)
        if option is None:
            raise InputError(f"a model of {target} has no {path}; apply the result to a tracker.")
        implies = option.implies
        implied = {}
        if implies and not option.applies_with(getattr(options, implies[0], implies[1])):
            implied = dict([implies])
        new = _value(option, getattr(options, option.name), index.rstrip("]"), value)
        options = dataclasses.replace(options, **{option.name: new, **implied})
    return options


def _value(option: Option, before: Any, index: str, value: Any) -> Any:
    """A tracker value in the option's units; the option's other numbers are unchanged."""
    if not option.length:
        return option.kind(value)
    numbers = list(before)
    given = {int(index): value} if index else dict(enumerate(value))
    for place, number in given.items():
        numbers[place] = float(number) / (option.factors[place] if option.factors else 1.0)
    return tuple(numbers)
