"""Translate between tuned tracker parameters and command-line options."""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from jaxpf.contract.errors import InputError
from jaxpf.contract.options import Option, applying, options_of
from jaxpf.targets.target import Target

if TYPE_CHECKING:
    from jax.typing import ArrayLike


def tuned_by_default(owner: Callable[..., Any], values: Mapping[str, Any]) -> tuple[str, ...]:
    """Paths of the parameters that are tuned by default, of a factory with these options."""
    applies = applying(owner, values)
    return tuple(
        option.path + ending
        for name, option in options_of(owner).items()
        if name in applies
        for ending in option.tuned
    )


def with_tuned(
    target: Target, options: Mapping[str, Any], values: "Mapping[str, ArrayLike]"
) -> dict[str, Any]:
    """Replace a target's options by tuned values.

    Args:
        target: the kind of target.
        options: values of its options.
        values: tracker path -> value, such as ``dynamics.scale[0]``, or ``dynamics.scale`` for all
            numbers of the option.
    """
    changed = dict(options)
    declared = options_of(target.tracker).values()
    by_path = {option.path: option for option in declared if option.path}
    for path, value in values.items():
        name, _, index = path.partition("[")
        option = by_path.get(name)
        if option is None:
            raise InputError(
                f"a model of {target.name} has no {path}; apply the result to a tracker."
            )
        if not option.applies(changed):
            changed[option.needs[0]] = option.needs[1]
        before = changed[option.name]
        changed[option.name] = option.checked(_value(option, before, index.rstrip("]"), value))
    return changed


def _value(option: Option, before: Any, index: str, value: Any) -> Any:
    """A tracker value in the option's units; the option's other numbers are unchanged."""
    if not option.length:
        return option.kind(value)
    numbers = list(before)
    given = {int(index): value} if index else dict(enumerate(value))
    for place, number in given.items():
        numbers[place] = float(number) / (option.factors[place] if option.factors else 1.0)
    return tuple(numbers)
