"""The plan of an evaluation: methods, orderings, a grid of options, and runs; checked when made.

``complete`` fills it in for a scene's target, and ``configurations`` lists what it means.
"""

import contextlib
import dataclasses
import itertools
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

from jaxpf import filters
from jaxpf.contract.errors import Argument, InputError
from jaxpf.contract.numbers import check_whole, plain
from jaxpf.contract.options import (
    Option,
    applying,
    defaults_of,
    implied,
    options_of,
)
from jaxpf.evaluation.results import Configuration
from jaxpf.evaluation.scene import SceneSource
from jaxpf.filters import registry
from jaxpf.filters.registry import GIVEN, ORDERS, Filter, all_filters
from jaxpf.ordering import SWAPS
from jaxpf.targets.registry import DEFAULT, all_targets, find_target
from jaxpf.targets.target import Start, Target
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
        methods: from ``jaxpf.filters.registry.methods()``.  None selects the default filters that
            suit the scene; with a single object only the first, because all orderings coincide.
        orders: for methods with an order: "given", as the scene lists the objects (a part tree
            level by level); "shifts", every circular shift; or permutations such as (2, 0, 1),
            counted from 0.
        swaps: for methods that swap, from ``jaxpf.ordering.SWAPS``.
        grid: option name -> values; other options have their defaults.  Options come from the
            target (``jaxpf.targets``) and the methods' filters, such as "sharpness",
            "noise_pixels", "num_particles" and "resampling".
        target: from ``jaxpf.targets.registry.all_targets()``; None for that of the scene's truth.
        runs: independent runs per configuration.
        seed: of all runs.  Run r of every configuration has the key ``fold_in(key(seed), r)``.
        tracks: results of other trackers, name -> MOT file or CSV with the header
            ``frame,id,x,y,w,h``; each enters the tables as one run.
        trackers: user-defined trackers, name -> function of the scene, see
            ``jaxpf.evaluation.trackers``; hashable, and picklable if there are worker processes.

    Raises:
        InputError: a value is out of range or occurs twice.
    """

    scene: SceneSource
    methods: Sequence[str] | None = None
    orders: Sequence[Any] = (GIVEN,)
    swaps: Sequence[str] = SWAPS[-1:]
    grid: Mapping[str, Sequence[Any]] = dataclasses.field(default_factory=dict)
    target: str | None = None
    runs: int = 50
    seed: int = 0
    tracks: Mapping[str, str | os.PathLike[str]] = dataclasses.field(default_factory=dict)
    trackers: Mapping[str, Callable[[Scene], Any]] = dataclasses.field(default_factory=dict)

    def __post_init__(self) -> None:
        for method in self.methods or ():
            filters.filter_of(method)
        if self.methods or (self.methods is not None and not (self.tracks or self.trackers)):
            self._keep("methods", self.methods)
        self._keep("orders", map(_order, self.orders))
        swap = options_of(*(each.build for each in all_filters().values()))["swap"]
        swaps = dataclasses.replace(swap, name="swaps")
        self._keep("swaps", map(swaps.checked, self.swaps))
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
        names, built_in = [*self.tracks, *self.trackers], registry.methods()
        for name in names:
            fits = 0 < len(name) <= _LONGEST_NAME and name.isprintable()
            if not fits or name.lower() in built_in or names.count(name) > 1:
                raise InputError(
                    f"a tracker cannot be called {name[:_LONGEST_NAME]!r}; give each a name of its "
                    f"own, of at most {_LONGEST_NAME} letters on one line and none of "
                    f"{', '.join(built_in)}."
                )

    def _keep(self, name: str, values: Iterable[object]) -> None:
        object.__setattr__(self, name, _distinct(name, values))

    def options_for(self, target: Target) -> dict[str, Option]:
        """Options allowed in the grid: those of a target and of the methods' filters."""
        options = options_of(target.tracker)
        for filter_ in self.filters():
            own = options_of(filter_.build)
            asked = [m for m in filter_.methods if self.methods is None or m in self.methods]
            allowed = set().union(*(applicable(filter_, method) for method in asked))
            options |= {n: own[n] for n in own if n in allowed - {*filter_.varied, *options}}
        return options

    def filters(self) -> list[Filter]:
        """The filters of the methods."""
        every = all_filters().values()
        return [f for f in every if self.methods is None or {*f.methods} & {*self.methods}]

    def _checked_grid(self) -> dict[str, tuple[Any, ...]]:
        """The grid in normal form; values are valid for the target, or for any if none is set."""
        # The default target comes first, because error messages refer to it.
        targets = sorted(all_targets().values(), key=lambda target: target.name != DEFAULT)
        if self.target:
            targets = [find_target(self.target)]
        every = [self.options_for(target) for target in targets]
        grid = {}
        for name, values in self.grid.items():
            having = [options[name] for options in every if name in options]
            if not having:
                known = ", ".join(dict.fromkeys(n for options in every for n in options))
                raise InputError(
                    f"{name} is not an option of this target and these methods, which are {known}; "
                    "leave it out."
                )
            grid[name] = _distinct(name, [_allowed(having, value) for value in values])
        return grid


def _methods_with(option: str) -> set[str]:
    """The methods whose variants set an option, such as "order"."""
    asked = {"order": (GIVEN,), "swap": SWAPS}
    return {
        method
        for filter_ in all_filters().values()
        for method in filter_.methods
        if any(option in variant.values for variant in filter_.variants(method, (-1,), asked))
    }


def applicable(filter_: Filter, method: str) -> set[str]:
    """The options of a filter that apply to one of its methods."""
    return {*applying(defaults_of(filter_.build) | {"method": method}, filter_.build)}


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


def complete(plan: Plan, name: str, parents: Sequence[int] | None = None) -> Plan:
    """Fill in the target, the methods and all values of the grid.

    Args:
        plan: as requested.
        name: target to use if the plan has none.
        parents: the part tree, from which methods are chosen if the plan has none.

    Raises:
        InputError: the target lacks an option of the grid or rejects a value.
    """
    target, methods = find_target(plan.target or name), plan.methods
    if methods is None and parents is not None:
        methods = _default_methods(target, parents)
    plan = dataclasses.replace(plan, target=target.name, methods=methods)
    # Where defaults differ between filters, each filter uses its own.
    owners: list[Callable[..., Any]] = [
        target.tracker,
        *(filter_.build for filter_ in plan.filters()),
    ]
    declared = [options_of(owner) for owner in owners]
    defaults = {
        name: (option.default,)
        for name, option in plan.options_for(target).items()
        if all(own[name].default == option.default for own in declared if name in own)
    }
    implications = implied(plan.grid, target.tracker)
    grid = {**defaults, **plan.grid, **{name: (value,) for name, value in implications.items()}}
    return dataclasses.replace(plan, grid=grid)


def _default_methods(target: Target, parents: Sequence[int]) -> tuple[str, ...]:
    """The methods that are compared by default and suit a part tree."""
    usual = target.defaults.get("method")
    methods: tuple[str, ...] = ()
    for filter_ in all_filters().values():
        if filter_.by_default or usual in filter_.methods:
            suiting = tuple(
                m
                for m in filter_.methods
                if filter_.admits(m, parents) and m not in target.unsuited
            )
            # The default methods differ in ordering only, so one object needs just the first.
            methods += suiting[:1] if filter_.by_default and len(parents) == 1 else suiting
    return methods


def configurations(
    plan: Plan, start: Start, settle: Callable[[Target, dict[str, Any], int], dict[str, Any]]
) -> list[Configuration]:
    """All configurations of the built-in methods of a complete plan.

    Args:
        plan: result of ``complete``.
        start: initial state of the objects.
        settle: function from (target, values of its options, particles) to the values with every
            "auto" settled.

    Raises:
        InputError: an order is not a permutation of the objects; options are incompatible.
    """
    assert plan.target is not None  # by complete
    target = find_target(plan.target)
    asked = {"order": plan.orders, "swap": plan.swaps}
    settled: dict[Any, Any] = {}
    listed: dict[str, Configuration] = {}
    for point in _points(plan, target):
        for method in plan.methods or ():
            filter_ = filters.filter_of(method)
            declared = options_of(target.tracker, filter_.build)
            of_filter = defaults_of(filter_.build)
            left_out = of_filter.keys() - applicable(filter_, method)
            own = {n: v for n, v in point.items() if n in declared.keys() - left_out}
            rest = of_filter.keys() - {*filter_.varied, *own}
            own |= {name: value for name, value in of_filter.items() if name in rest}
            model = {n: own.get(n, d) for n, d in defaults_of(target.tracker).items()}
            numbers = [n for n in (own["num_particles"], *plan.grid.get("num_particles", ())) if n]
            particles = max(numbers, default=1)
            key = (*model.values(), particles)
            if key not in settled:
                settled[key] = settle(target, model, particles)
            parameters = own | {name: settled[key][name] for name in own if name in model}
            for variant in filter_.variants(method, start.parents, asked):
                filter_.check_model(of_filter | parameters | variant.values, start.parents)
                configuration = Configuration(
                    method.upper(), variant.label, parameters, variant.values
                )
                listed.setdefault(repr(configuration), configuration)
    return list(listed.values())


def _points(plan: Plan, target: Target) -> Iterator[dict[str, Any]]:
    """Every point of the grid; options that force recompilation vary slowest."""
    options = plan.options_for(target)
    names = sorted(options, key=lambda name: options[name].compiles)
    names = [name for name in names if name in plan.grid]
    loops = list(reversed(names))
    for values in itertools.product(*(plan.grid[name] for name in loops)):
        point = dict(zip(loops, values, strict=True))
        yield {name: point[name] for name in names}


def _distinct(name: str, values: Iterable[object]) -> tuple[Any, ...]:
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
