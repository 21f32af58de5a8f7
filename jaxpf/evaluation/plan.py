"""The plan of an evaluation: methods, orderings, a grid of options, and runs; checked when made.

``configurations`` completes a plan and lists its configurations.
"""

import contextlib
import dataclasses
import os
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from jaxpf import filters
from jaxpf.contract.errors import Argument, InputError, check_type
from jaxpf.contract.numbers import check_whole
from jaxpf.contract.options import Option, applying, check_distinct, defaults_of, options_of
from jaxpf.filters.registry import GIVEN, ORDERS, Filter
from jaxpf.ordering import SWAPS
from jaxpf.targets import DEFAULT, all_targets, find_target
from jaxpf.targets.target import Target

if TYPE_CHECKING:
    from scenes import Scene

#: Largest number of runs per configuration; planning more batches would take minutes.
_MOST_RUNS = 10**6
#: Longest tracker name that fits in tables and file names, in letters.
_LONGEST_NAME = 100


@dataclasses.dataclass(frozen=True)
class Plan:
    """Methods x orderings x grid of options x runs, on one scene.

    Attributes:
        scene: what ``scenes.open_scene`` or ``Sequence.scene`` returns, or a function without
            arguments that returns it.  For worker processes the function must be picklable, such as
            ``functools.partial(load, source="distracter", seed=0)`` with ``load`` from a module;
            every worker then opens the scene once.
        methods: from ``jaxpf.filters.methods()``.  None selects the default filters that suit the
            scene; with a single object only the first, because all orderings coincide.
        orders: for methods with an order: "given", as the scene lists the objects (a part tree
            level by level); "shifts", every circular shift; or permutations such as (2, 0, 1),
            counted from 0.
        swaps: for methods that swap, from ``jaxpf.ordering.SWAPS``.
        grid: option name -> values; other options have their defaults.  Options come from the
            target (``jaxpf.targets``) and the methods' filters, such as "sharpness",
            "noise_pixels", "num_particles" and "resampling".
        target: from ``jaxpf.targets.all_targets()``; None for the target of the scene's truth.
        runs: independent runs per configuration.
        seed: of all runs.  Run r of every configuration has the key ``fold_in(key(seed), r)``.
        tracks: results of other trackers, name -> MOT file or CSV with the header
            ``frame,id,x,y,w,h``; each enters the tables as one run.
        trackers: user-defined trackers, name -> function of the scene, see
            ``jaxpf.evaluation.trackers``; picklable if there are worker processes.

    Raises:
        InputError: a value is out of range or occurs twice.
    """

    scene: "Scene | Callable[[], Scene]"
    methods: Sequence[str] | None = None
    orders: Sequence[Any] = (GIVEN,)
    swaps: Sequence[str] = SWAPS[-1:]
    grid: Mapping[str, Sequence[Any]] = dataclasses.field(default_factory=dict)
    target: str | None = None
    runs: int = 50
    seed: int = 0
    tracks: Mapping[str, str | os.PathLike[str]] = dataclasses.field(default_factory=dict)
    trackers: "Mapping[str, Callable[[Scene], Any]]" = dataclasses.field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("grid", "tracks", "trackers"):
            check_type(name, getattr(self, name), Mapping)
        for name in ("methods", "orders", "swaps"):
            values = getattr(self, name)
            if values is not None or name != "methods":
                object.__setattr__(self, name, _listed(name, values))
        built_in = filters.methods()
        if self.methods is not None:
            for method in self.methods:
                filters.filter_of(method)
            if self.methods or not (self.tracks or self.trackers):
                self._keep("methods", self.methods)
        self._keep("orders", [_order(value) for value in self.orders])
        swap = options_of(*(each.build for each in filters.all_filters().values()))["swap"]
        swaps = dataclasses.replace(swap, name="swaps")
        self._keep("swaps", [swaps.checked(value) for value in self.swaps])
        for name, option in (("orders", "order"), ("swaps", "swap")):
            default = type(self).__dataclass_fields__[name].default
            owners = _methods_with(option)
            if getattr(self, name) != default and self.methods and not owners & {*self.methods}:
                raise InputError(
                    f"{name} are those of {' and '.join(sorted(owners))}, which is not among the "
                    f"methods {', '.join(self.methods)}; leave them out, or name it."
                )
        object.__setattr__(self, "grid", self._checked_grid())
        for name, least, most in (("runs", 1, _MOST_RUNS), ("seed", 0, 2**32 - 1)):
            check_whole(name, getattr(self, name), least, most)
        for name, path in self.tracks.items():
            check_type(f"tracks[{name!r:.60}]", path, str, os.PathLike)
        for name, function in self.trackers.items():
            if not callable(function):
                raise InputError(f"trackers[{name!r:.60}] must be a function of the scene.")
        names = [*self.tracks, *self.trackers]
        for name in names:
            check_type("the name of a tracker", name, str)
            if not name.isprintable() or len(name) > _LONGEST_NAME:
                raise InputError(
                    f"a tracker cannot be called {name[:_LONGEST_NAME]!r}; give each a name of at "
                    f"most {_LONGEST_NAME} letters on one line."
                )
            if not name or name.lower() in built_in or names.count(name) > 1:
                raise InputError(
                    f"a tracker cannot be called {name!r}; give each a name of its own that is "
                    f"none of {', '.join(built_in)}."
                )

    def _keep(self, name: str, values: Iterable[object]) -> None:
        object.__setattr__(self, name, check_distinct(name, values))

    def targets(self) -> list[Target]:
        """Targets whose options apply, the default first, because error messages refer to it."""
        if self.target:
            return [find_target(self.target)]
        every = all_targets().values()
        return sorted(every, key=lambda target: target.name != DEFAULT)

    def options_for(self, target: Target) -> dict[str, Option]:
        """Options allowed in the grid: those of a target and of the methods' filters."""
        options = options_of(target.tracker)
        for filter_ in self.filters():
            own = options_of(filter_.build)
            asked = [m for m in filter_.methods if self.methods is None or m in self.methods]
            applying = {n for m in asked for n, has in applicable(filter_, m).items() if has}
            options |= {n: own[n] for n in own if n in applying - {*filter_.varied, *options}}
        return options

    def filters(self) -> list[Filter]:
        """The filters of the methods."""
        every = filters.all_filters().values()
        if self.methods is None:
            return [*every]
        return [filter_ for filter_ in every if set(filter_.methods) & set(self.methods)]

    def _checked_grid(self) -> dict[str, tuple[Any, ...]]:
        """The grid in normal form; values are valid for the target, or for any if none is set."""
        every = [self.options_for(target) for target in self.targets()]
        grid = {}
        for name, values in self.grid.items():
            having = [options[name] for options in every if name in options]
            if not having:
                raise self._unknown(name, dict.fromkeys(n for options in every for n in options))
            grid[name] = check_distinct(name, [_allowed(having, value) for value in values])
        return grid

    def _unknown(self, name: str, known: Collection[str]) -> InputError:
        """The error for an option that is unknown or belongs to other targets or methods."""
        having = [kind for kind, of in all_targets().items() if name in options_of(of.tracker)]
        whose = f" of {self.target}" if self.target else ""
        if having:
            return InputError(
                f"{name} is not an option{whose}, but of {' and '.join(having)}; leave it out."
            )
        for filter_ in filters.all_filters().values():
            if name in options_of(filter_.build) and name not in filter_.varied:
                having = [m for m in filter_.methods if applicable(filter_, m)[name]]
                return InputError(
                    f"{name} is an option of {', '.join(having)}, and not of "
                    f"{', '.join(self.methods or ())}; leave it out, or name one of them among "
                    "the methods."
                )
        return InputError(f"{name} is not an option{whose}; the options are {', '.join(known)}.")


def _listed(name: str, values: Any) -> tuple[Any, ...]:
    try:
        return tuple(values)
    except TypeError:
        raise InputError(f"{name} is {values!r:.60}; give a list.") from None


def _methods_with(option: str) -> set[str]:
    """The methods whose variants set an option, such as "order"."""
    asked = {"order": (GIVEN,), "swap": SWAPS}
    return {
        method
        for filter_ in filters.all_filters().values()
        for method in filter_.methods
        if any(option in variant.values for variant in filter_.variants(method, (-1,), asked))
    }


def applicable(filter_: Filter, method: str) -> dict[str, bool]:
    """Option name -> whether the option applies to one of the filter's methods."""
    values = defaults_of(filter_.build) | {"method": method}
    return {name: name in applying(filter_.build, values) for name in values}


def _allowed(options: Sequence[Option], value: object) -> Any:
    """Return the value in normal form if any of the options allows it."""
    for option in options[1:]:
        with contextlib.suppress(InputError):
            return option.checked(value)
    return options[0].checked(value)


def _order(value: object) -> Any:
    if value in ORDERS:
        return value
    entries = tuple(value) if isinstance(value, Sequence) and not isinstance(value, str) else ()
    if not entries or not all(isinstance(entry, int) for entry in entries):
        raise InputError(
            Argument("orders", repr(value), ": "),
            f" is not an order; give {', '.join(map(repr, ORDERS))}, or the objects by their "
            "place, such as (2, 0, 1).",
        )
    return entries
