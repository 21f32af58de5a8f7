"""Options: parameters of a function, or fields of a dataclass, annotated with help and range::

    def tracker(frame, boxes, *, momentum: Annotated[float, Option("Help.", most=1)] = 0.3): ...

Flags, TOML keys, the grids of evaluations, and the one check of a value are read from here.
"""

import dataclasses
import functools
import inspect
import math
import types
import typing
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from jaxpf.contract.errors import Argument, InputError, check_known, choice
from jaxpf.contract.numbers import LARGEST, MOST, bounds_in_words, check_number, check_whole, plain

#: The value of an option that is settled automatically.
OPEN = "auto"
_NOUNS = {bool: "true or false", int: "a whole number", float: "a finite number", Path: "a path"}
_MANY = {int: "whole numbers", float: "finite numbers"}


@dataclasses.dataclass(frozen=True)
class Option:
    """What an annotation says of an option.

    Attributes:
        help: what it does, in sentences; ranges and choices are added.
        least: smallest allowed value.
        above: exclusive lower bound.
        most: largest allowed value.
        needs: another option of the same owner, then its values with which this one applies; giving
            this one selects the first of them if the other is left open.
        flags: further flags, such as ``-n``.
        rare: whether the command line takes it by ``--set NAME=VALUE`` instead of a flag.
        path: the value's pytree path in a tracker, if it can be tuned.
        factors: factors from the option's numbers to those in the tracker, such as degrees to
            radians; () for 1.
        tuned: endings of the path, such as "[0]", that are tuned by default.
        compiles: whether a new value compiles a new kernel.
        places: whether the values are indices of objects, typed from 1 and stored from 0.
        per_object: whether a tuple may hold its numbers once for every object.
        name: the parameter's name; this and the rest are read from the signature.
        default: its default; None means unset.
        kind: type of the value, or of each entry of a tuple.
        length: 0 for a single value, n for a tuple of n values, -1 for a tuple of any length.
        choices: allowed names; () allows any value.
    """

    help: str
    _: dataclasses.KW_ONLY
    least: float = -math.inf
    above: float = -math.inf
    most: float = math.inf
    needs: tuple[str, ...] = ()
    flags: tuple[str, ...] = ()
    rare: bool = False
    path: str = ""
    factors: tuple[float, ...] = ()
    tuned: tuple[str, ...] = ()
    compiles: bool = False
    places: bool = False
    per_object: bool = False
    name: str = ""
    default: Any = None
    kind: type = str
    length: int = 0
    choices: tuple[str, ...] = ()

    @property
    def flag(self) -> str:
        """How the command line spells it, such as ``--num-particles`` or ``--set resampling``."""
        return f"--set {self.name}" if self.rare else f"--{self.name.replace('_', '-')}"

    def applies(self, values: Mapping[str, Any]) -> bool:
        """Whether it applies with these values of the owner's options."""
        return not self.needs or values.get(self.needs[0], self.needs[1]) in self.needs[1:]

    def checked(self, value: Any) -> Any:
        """Return the value converted to the option's type.

        Raises:
            InputError: its type is wrong, or it is out of range.
        """
        if value is None and self.default is None:
            return value
        if self.choices:
            if not isinstance(value, str) or value not in self.choices:
                known = ", ".join(self.choices)
                raise InputError(
                    Argument(self.name, repr(value)), f" is unknown; choose one of {known}."
                )
            return value
        many = isinstance(value, Sequence) and not isinstance(value, str)
        entries = tuple(value) if many else (value,)
        if not self._fits(len(entries), many) or not all(map(self._allows, entries)):
            shown = Argument(self.name, plain(value) or repr(value))
            raise InputError(shown, f" must be {self.wanted}.")
        entries = tuple(self.kind(entry) for entry in entries)
        return entries if many else entries[0]

    @property
    def wanted(self) -> str:
        """The allowed values in words."""
        noun = _NOUNS.get(self.kind, "a name")
        if self.length:
            count = {2: "two ", 3: "three "}.get(self.length, "")
            noun = count + _MANY.get(self.kind, "names")
            if self.per_object:
                noun += f", or {count.strip()} for every object,"
        bounds = bounds_in_words(above=self.above, least=self.least, most=self.most)
        example = f", such as {plain(self.default)}" if self.length > 0 and self.default else ""
        return f"{noun}{bounds}{example}"

    def _fits(self, count: int, many: bool) -> bool:
        if self.length <= 0 or not many:
            return many == (self.length != 0)
        return count == self.length or (self.per_object and count > 0 and count % self.length == 0)

    def _allows(self, value: object) -> bool:
        if self.kind in (str, bool, Path):
            return isinstance(value, self.kind)
        if isinstance(value, bool) or not isinstance(value, int | float):
            return False
        if not abs(value) <= LARGEST or (self.kind is int and value != int(value)):
            return False
        return value > self.above and self.least <= value <= self.most


@functools.cache
def _declared(owner: Callable[..., Any]) -> Mapping[str, Option]:
    found = {}
    for name, parameter in inspect.signature(owner).parameters.items():
        hint, *notes = typing.get_args(parameter.annotation) or (None,)
        about = next((note for note in notes if isinstance(note, Option)), None)
        if about is not None:
            default = None if parameter.default is parameter.empty else parameter.default
            says = {**_type(hint), **({"length": about.length} if about.length else {})}
            found[name] = dataclasses.replace(about, name=name, default=default, **says)
    return found


def _type(hint: Any) -> dict[str, Any]:
    """What a type says: ``kind``, ``length`` and ``choices``."""
    arguments = typing.get_args(hint)
    if typing.get_origin(hint) is typing.Literal:
        return {"choices": arguments}
    if typing.get_origin(hint) in (typing.Union, types.UnionType):
        return _type(arguments[0])
    if typing.get_origin(hint) is tuple:
        length = -1 if arguments[-1] is Ellipsis else len(arguments)
        return {**_type(arguments[0]), "length": length}
    return {"kind": hint} if isinstance(hint, type) and hint is not Any else {}


def options_of(*owners: Callable[..., Any]) -> dict[str, Option]:
    """Map name to option for functions and dataclasses; the first declaration of a name wins."""
    found: dict[str, Option] = {}
    for owner in owners:
        found |= {n: option for n, option in _declared(owner).items() if n not in found}
    return found


def defaults_of(*owners: Callable[..., Any]) -> dict[str, Any]:
    """The defaults of the owners' options."""
    return {name: option.default for name, option in options_of(*owners).items()}


def complete(
    given: Mapping[str, Any],
    *owners: Callable[..., Any],
    defaults: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """The checked values of all options of functions and dataclasses.

    Args:
        given: name -> value; a value may imply others that were left open.
        owners: names that none of them declares are ignored.
        defaults: defaults that override the declared ones.

    Raises:
        InputError: a value is out of range, or two values conflict.
    """
    implies = implied({name: [value] for name, value in given.items()}, *owners)
    values = {**(defaults or {}), **given, **implies}
    declared = options_of(*owners).items()
    return {name: option.checked(values.get(name, option.default)) for name, option in declared}


def check_fields(owner: Any) -> None:
    """Refuse annotated fields of an object outside their ranges; traced values pass.

    Raises:
        InputError: names the field and its range.
    """
    for name, about in options_of(type(owner)).items():
        value = getattr(owner, name)
        if value is None and about.default is None:
            continue
        if about.choices:
            check_known(f"{name}=", value, about.choices)
        elif about.kind is int:
            most = MOST if math.isinf(about.most) else int(about.most)
            check_whole(name, value, int(about.least), most)
        else:
            check_number(name, value, above=about.above, least=about.least, most=about.most)


def implied(given: Mapping[str, Sequence[Any]], *owners: Callable[..., Any]) -> dict[str, Any]:
    """Return the values that given options imply for others: name -> value.

    Args:
        given: name -> all values given for it.
        owners: functions or dataclasses.

    Raises:
        InputError: given options exclude each other.
    """
    declared, values = options_of(*owners), dict[str, Any]()
    for name in given:
        if name not in declared or not declared[name].needs:
            continue
        other, wanted, *_ = needs = declared[name].needs
        others = [*given.get(other, ()), *([values[other]] if other in values else [])]
        for value in others:
            if value not in (OPEN, *needs[1:]):
                raise InputError(
                    Argument(name),
                    " works only with ",
                    choice(other, wanted),
                    f", but {value} was chosen, by name or by another option; leave one of them "
                    "out.",
                )
        if set(others) <= {wanted, OPEN}:
            values[other] = wanted
    return values


def applying(values: Mapping[str, Any], *owners: Callable[..., Any]) -> dict[str, Any]:
    """Those values of the owners' options that apply, given the others."""
    declared = options_of(*owners)
    return {
        n: values[n] for n, option in declared.items() if n in values and option.applies(values)
    }
