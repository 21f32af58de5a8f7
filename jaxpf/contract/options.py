"""Options, declared once as fields of frozen dataclasses.

Filters and targets declare their options in modules that import no JAX.  Flags, help, TOML keys,
evaluation grids and error messages are derived from the fields.
"""

import dataclasses
import math
import sys
import typing
from collections.abc import Hashable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from jaxpf.contract.errors import Argument, InputError, check_known, choice
from jaxpf.contract.numbers import bounds_in_words, check_number, check_whole, plain

_KEY = "option"
#: The value of an option that is settled automatically.
OPEN = "auto"
_NOUNS = {
    bool: "true or false",
    int: "a whole number",
    float: "a finite number",
    str: "a name",
    Path: "a path",
}


@dataclasses.dataclass(frozen=True)
class Option:
    """The declaration of an option.

    Attributes:
        name: name of the field; the flag replaces underscores by hyphens.
        default: default value; None means unset.
        kind: type of the value, or of each entry of a tuple: ``int``, ``float``, ``str``, ``bool``
            or ``Path``.
        help: one sentence.
        length: 0 for a single value, n for a tuple of n values, -1 for a tuple of any length.
        per_object: whether the tuple may hold n values per object, object after object.
        choices: allowed names; () allows any value.
        least: smallest allowed value.
        above: exclusive lower bound.
        most: largest allowed value.
        flags: further flags, such as ``-n``.
        common: whether ``--help`` explains it.
        path: the value's pytree path in a tracker, if it can be tuned.
        factors: factors from the option's values to those in the tracker, such as degrees to
            radians; () for 1.
        tuned: endings of the path, such as "[0]", that are tuned by default.
        compiles: whether a new value compiles a new kernel.
        places: whether the values are indices of objects, typed from 1 and stored from 0.
        implies: (name, value) of another option of the same owner.  This option applies only with
            that value; giving it selects that value if the other option is "auto".
        also_with: further values of the other option with which this one applies.
        opens: whether "auto" is also allowed; it is settled later.
    """

    name: str
    default: Any
    kind: type
    help: str
    length: int = 0
    per_object: bool = False
    choices: tuple[str, ...] = ()
    least: float = -math.inf
    above: float = -math.inf
    most: float = math.inf
    flags: tuple[str, ...] = ()
    common: bool = False
    path: str = ""
    factors: tuple[float, ...] = ()
    tuned: tuple[str, ...] = ()
    compiles: bool = False
    places: bool = False
    implies: tuple[str, str] | None = None
    also_with: tuple[str, ...] = ()
    opens: bool = False

    @property
    def flag(self) -> str:
        """The flag, such as ``--ess-threshold``."""
        return f"--{self.name.replace('_', '-')}"

    def applies_with(self, value: object) -> bool:
        """Whether the option applies with this value of the one that it implies."""
        return self.implies is None or value in (self.implies[1], *self.also_with)

    def checked(self, value: Any, shown: str = "") -> Any:
        """Return the value converted to the option's type.

        Args:
            value: the value; a list becomes a tuple.
            shown: how messages show the option; default its name and an equals sign, or its flag
                on the command line.

        Raises:
            InputError: the type is wrong or the value is out of range.
        """
        if (value is None and self.default is None) or (self.opens and value == OPEN):
            return value

        def named(text: str) -> Argument | str:
            return f"{shown} {text}" if shown else Argument(self.name, text)

        if self.choices and value not in self.choices:
            raise InputError(
                named(repr(value)), f" is unknown; choose one of {', '.join(self.choices)}."
            )
        many = isinstance(value, Sequence) and not isinstance(value, str)
        values = tuple(value) if many else (value,)
        if not self._fits(values, many) or not all(self._allows(entry) for entry in values):
            raise InputError(named(plain(value) or repr(value)), f" must be {self.wanted}.")
        values = tuple(self.kind(entry) for entry in values)
        return values if many else values[0]

    @property
    def wanted(self) -> str:
        """The allowed values in words."""
        noun = _NOUNS.get(self.kind, "")
        if self.length:
            count = {2: "two ", 3: "three "}.get(self.length, "")
            noun = count + {int: "whole numbers", float: "finite numbers"}.get(self.kind, "names")
            if self.per_object:
                noun += f", or {count.strip()} for every object,"
        bounds = bounds_in_words(above=self.above, least=self.least, most=self.most)
        example = f", such as {plain(self.default)}" if self.length > 0 and self.default else ""
        return f"{noun}{bounds}{example}"

    def _fits(self, values: tuple[object, ...], many: bool) -> bool:
        if self.length <= 0 or not many:
            return many == (self.length != 0)
        if self.per_object:
            return len(values) > 0 and len(values) % self.length == 0
        return len(values) == self.length

    def _allows(self, value: object) -> bool:
        if self.kind in (str, bool, Path):
            return isinstance(value, self.kind)
        if isinstance(value, bool) or not isinstance(value, int | float):
            return False
        if not abs(value) <= sys.float_info.max or (self.kind is int and value != int(value)):
            return False
        return value > self.above and self.least <= value <= self.most


def option(default: Any, help: str, **about: Any) -> Any:
    """Declare a field of an options class; ``about`` are attributes of ``Option``."""
    length = {"length": len(default)} if isinstance(default, tuple) and default else {}
    declared = {"help": help, **length, **about}
    return dataclasses.field(default=default, metadata={_KEY: declared})


def _kind_and_length(annotation: Any) -> tuple[type, int]:
    """Return a value's type, and 0 for a single value or -1 for a tuple."""
    inner = typing.get_args(annotation)
    if not inner:
        return annotation, 0
    kind, length = _kind_and_length(inner[0])
    return kind, -1 if typing.get_origin(annotation) is tuple else length


def options_of(*owners: Any) -> dict[str, Option]:
    """Map name to option for several options classes; the first declaration of a name wins."""
    options: dict[str, Option] = {}
    for owner in owners:
        for field in dataclasses.fields(owner):
            if _KEY in field.metadata:
                kind, length = _kind_and_length(field.type)
                about = {"kind": kind, "length": length, **field.metadata[_KEY]}
                options.setdefault(field.name, Option(field.name, field.default, **about))
    return options


def check_options(options: object) -> None:
    """Convert every field to its type, or refuse it; for ``__post_init__``.

    Raises:
        InputError: see ``Option.checked``.
    """
    for name, declared in options_of(options).items():
        object.__setattr__(options, name, declared.checked(getattr(options, name)))


def check_declared(owner: Any, options: type, *names: str, **renamed: str) -> None:
    """Refuse fields of a tracker that are outside the ranges of their options.

    Traced values pass, and so does None where it is the field's default.

    Args:
        owner: a dataclass whose constructor takes the values.
        options: the options class that declares their ranges.
        names: of the fields.
        renamed: name of a field -> name of its option, if they differ.
    """
    declared, defaults = options_of(options), type(owner).__dataclass_fields__
    for field, name in (dict(zip(names, names, strict=True)) | renamed).items():
        value, about = getattr(owner, field), declared[name]
        if value is None and defaults[field].default is None:
            continue
        if about.choices:
            check_known(f"{field}=", value, about.choices)
        elif about.kind is int:
            check_whole(field, value, int(about.least), int(about.most))
        else:
            check_number(field, value, above=about.above, least=about.least, most=about.most)


def implied(owner: type, given: Mapping[str, Sequence[Any]]) -> dict[str, Any]:
    """Return the values that given options imply for others: name -> value.

    Args:
        owner: an options class.
        given: name -> all values given for it.

    Raises:
        InputError: given options exclude each other.
    """
    declared, values = options_of(owner), dict[str, Any]()
    for name in given:
        giver = declared.get(name)
        if giver is None or giver.implies is None or giver.implies[0] not in declared:
            continue
        other, wanted = giver.implies
        chosen_values = [*given.get(other, ()), *([values[other]] if other in values else [])]
        for value in chosen_values:
            if value != OPEN and not giver.applies_with(value):
                raise InputError(
                    Argument(name),
                    " works only with ",
                    choice(other, wanted),
                    f", but {value} was chosen, by name or by another option; leave one of them "
                    "out.",
                )
        if set(chosen_values) <= {wanted, OPEN}:
            values[other] = wanted
    return values


def counting(options: object) -> dict[str, bool]:
    """Map each name to whether the option applies, given the values of the others."""
    declared = options_of(options)
    return {
        name: entry.implies is None
        or entry.implies[0] not in declared
        or entry.applies_with(getattr(options, entry.implies[0]))
        for name, entry in declared.items()
    }


def chosen(owner: type, values: Mapping[str, Any]) -> Any:
    """Construct an options class from the values that it declares; ignore the others."""
    return owner(**{name: values[name] for name in options_of(owner) if name in values})


def check_distinct(name: str, values: Iterable[Hashable]) -> tuple[Any, ...]:
    """Return the values as a tuple.

    Raises:
        InputError: no values, or a duplicate.
    """
    values = tuple(values)
    if not values:
        raise InputError(Argument(name), " is empty; give at least one value.")
    for index, value in enumerate(values):
        if value in values[:index]:
            raise InputError(Argument(name), f" names {plain(value)} twice; name each value once.")
    return values
