"""Completes a plan for a scene's target, and lists the configurations that it means."""

import dataclasses
import itertools
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from jaxpf import filters
from jaxpf.contract.options import defaults_of, implied, options_of
from jaxpf.evaluation.plan import Plan, applicable
from jaxpf.evaluation.results import Configuration
from jaxpf.targets import find_target
from jaxpf.targets.target import Start, Target


def complete(plan: Plan, name: str, parents: Sequence[int] | None = None) -> Plan:
    """Fill in the target, the methods and all values of the grid.

    Args:
        plan: as requested.
        name: target to use if the plan has none.
        parents: the part tree, from which methods are chosen if the plan has none.

    Raises:
        InputError: the target lacks an option of the grid or rejects a value.
    """
    methods = plan.methods
    if methods is None and parents is not None:
        methods = _default_methods(find_target(plan.target or name), parents)
    plan = dataclasses.replace(plan, target=plan.target or name, methods=methods)
    target = find_target(plan.target or name)
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
    implications = implied(target.tracker, plan.grid)
    grid = {**defaults, **plan.grid, **{name: (value,) for name, value in implications.items()}}
    return dataclasses.replace(plan, grid=grid)


def _default_methods(target: Target, parents: Sequence[int]) -> tuple[str, ...]:
    """The methods that are compared by default and suit a part tree."""
    usual = target.defaults.get("method")
    methods: tuple[str, ...] = ()
    for filter_ in filters.all_filters().values():
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
            applies = applicable(filter_, method)
            own = {n: v for n, v in point.items() if n in declared and applies.get(n, True)}
            of_filter = defaults_of(filter_.build)
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
