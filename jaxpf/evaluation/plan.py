"""The plan of an evaluation: methods, orderings, a grid of options, and runs.

This module does not import JAX, so a stored evaluation can be compared with a plan quickly.
"""

import contextlib
import dataclasses
import functools
import hashlib
import itertools
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from jaxpf import filters
from jaxpf.contract.errors import Argument, InputError
from jaxpf.contract.options import Option, check_distinct, chosen, counting, implied, options_of
from jaxpf.evaluation.results import Configuration
from jaxpf.files.writing import report_os_errors
from jaxpf.filters.filter import Filter
from jaxpf.targets import DEFAULT, adapters, find_adapter
from jaxpf.targets.target import Start, Target

#: Exclusive limit on runs per configuration; planning more batches would take minutes.
_MOST_RUNS = 10**6 + 1
#: Longest tracker name that fits in tables and file names, in letters.
_LONGEST_NAME = 100


@dataclasses.dataclass(frozen=True)
class Plan:
    """Methods x orderings x grid of options x runs, on one scene.

    Attributes:
        scene: what ``scenes.open_scene`` returns, or a function without arguments that returns
            it.  For worker processes the function must be picklable, such as
            ``functools.partial(load, source="distracter", seed=0)`` with ``load`` from a module;
            every worker then opens the scene once.
        methods: from ``jaxpf.filters.methods()``.  None selects the default filters that suit the
            scene; with a single object only the first, because all orderings coincide.
        orders: for methods with an order: "given", as the scene lists the objects (a part tree
            level by level); "shifts", every circular shift; or permutations such as (2, 0, 1),
            counted from 0.
        swaps: for methods that swap, from ``jaxpf.contract.names.SWAPS``.
        grid: option name -> values; other options have their defaults.  Options come from the
            target (``jaxpf.targets``) and the methods' filters, such as "sharpness", "scale",
            "particles" and "resampling".
        target: from ``jaxpf.targets.adapters()``; None for the target of the scene's truth.
        runs: independent runs per configuration.
        seed: of all runs.  Run r of every configuration has the key ``fold_in(key(seed), r)``.
        tracks: results of other trackers, name -> MOT file or CSV with the header
            ``frame,id,x,y,w,h``; each enters the tables as one run.
        trackers: user-defined trackers, name -> function of the scene, see
            ``jaxpf.evaluation.trackers``; picklable if there are worker processes.

    Raises:
        InputError: a value is out of range or occurs twice.
    """

    scene: Any
    methods: Sequence[str] | None = None
    orders: Sequence[Any] = ("given",)
    swaps: Sequence[str] = ("combinatorial",)
    grid: Mapping[str, Sequence[Any]] = dataclasses.field(default_factory=dict)
    target: str | None = None
    runs: int = 50
    seed: int = 0
    tracks: Mapping[str, str | os.PathLike[str]] = dataclasses.field(default_factory=dict)
    trackers: Mapping[str, Callable[[Any], Any]] = dataclasses.field(default_factory=dict)

    def __post_init__(self) -> None:
        known = filters.methods()
        if self.methods is not None:
            for method in self.methods:
                filters.filter_of(method)
            if self.methods or not (self.tracks or self.trackers):
                self._keep("methods", self.methods)
        self._keep("orders", [_order(value) for value in self.orders])
        swaps = options_of(*(one.options for one in filters.all_filters().values()))["swap"]
        self._keep("swaps", [swaps.checked(value, "swaps:") for value in self.swaps])
        for name, option in (("orders", "order"), ("swaps", "swap")):
            default = type(self).__dataclass_fields__[name].default
            owners = _methods_with(option)
            if getattr(self, name) != default and self.methods and not owners & {*self.methods}:
                raise InputError(
                    f"{name} are those of {' and '.join(sorted(owners))}, which is not among the "
                    f"methods {', '.join(self.methods)}; leave them out, or name it."
                )
        object.__setattr__(self, "grid", self._checked_grid())
        for name, least, bound in (("runs", 1, _MOST_RUNS), ("seed", 0, 2**32)):
            self._check_whole(name, least, bound)
        names = [*self.tracks, *self.trackers]
        for name in names:
            if not name.isprintable() or len(name) > _LONGEST_NAME:
                raise InputError(
                    f"a tracker cannot be called {name[:_LONGEST_NAME]!r}; give each a name of at "
                    f"most {_LONGEST_NAME} letters on one line."
                )
            if not name or name.lower() in known or names.count(name) > 1:
                raise InputError(
                    f"a tracker cannot be called {name!r}; give each a name of its own that is "
                    f"none of {', '.join(known)}."
                )

    def _keep(self, name: str, values: Iterable[Any]) -> None:
        object.__setattr__(self, name, check_distinct(name, values))

    def _check_whole(self, name: str, least: int, bound: int) -> None:
        value = getattr(self, name)
        whole = isinstance(value, int) and not isinstance(value, bool)
        if not whole or not least <= value < bound:
            raise InputError(
                Argument(name, value), f" must be a whole number from {least} to {bound - 1}."
            )

    def _targets(self) -> list[Target]:
        """Targets whose options apply, the default first, because error messages refer to it."""
        if self.target:
            return [find_adapter(self.target).target]
        every = (one.target for one in adapters().values())
        return sorted(every, key=lambda one: one.name != DEFAULT)

    def _options(self, of: Target) -> dict[str, Option]:
        """Options allowed in the grid: those of a target and of the methods' filters."""
        found = options_of(of.options)
        for one in self._filters():
            its = options_of(one.options)
            asked = [m for m in one.methods if self.methods is None or m in self.methods]
            having = {n for m in asked for n, counts in _counting(one, m).items() if counts}
            found |= {n: its[n] for n in its if n in having - {*one.varied, *found}}
        return found

    def _filters(self) -> list[Filter]:
        """The filters of the methods."""
        every = filters.all_filters().values()
        return [
            one for one in every if self.methods is None or set(one.methods) & set(self.methods)
        ]

    def _checked_grid(self) -> dict[str, tuple[Any, ...]]:
        """The grid in normal form; values are valid for the target, or for any if none is set."""
        every = [self._options(one) for one in self._targets()]
        found = {}
        for name, values in self.grid.items():
            having = [options[name] for options in every if name in options]
            if not having:
                raise self._unknown(name, dict.fromkeys(n for options in every for n in options))
            found[name] = check_distinct(name, [_allowed(having, value) for value in values])
        return found

    def _unknown(self, name: str, known: Iterable[str]) -> InputError:
        """The error for an option that is unknown or belongs to other targets or methods."""
        having = [n for n, one in adapters().items() if name in options_of(one.target.options)]
        whose = f" of {self.target}" if self.target else ""
        if having:
            return InputError(
                f"{name} is no option{whose}, but of {' and '.join(having)}; leave it out."
            )
        for one in filters.all_filters().values():
            if name in options_of(one.options) and name not in one.varied:
                having = [method for method in one.methods if _counting(one, method)[name]]
                return InputError(
                    f"{name} is an option of {', '.join(having)}, and not of "
                    f"{', '.join(self.methods or ())}; leave it out, or name one of them among "
                    "the methods."
                )
        return InputError(f"{name} is no option{whose}; the options are {', '.join(known)}.")

    def for_target(self, name: str, parents: Sequence[int] | None = None) -> "Plan":
        """Fill in the target, the methods and all values of the grid.

        Args:
            name: target to use if the plan has none.
            parents: the part tree, from which methods are chosen if the plan has none.

        Raises:
            InputError: the target lacks an option of the grid or rejects a value.
        """
        methods = self.methods
        if methods is None and parents is not None:
            own = find_adapter(self.target or name).target.defaults.get("method")
            every = filters.all_filters().values()
            methods = ()
            for one in (one for one in every if one.by_default or own in one.methods):
                suiting = tuple(m for m in one.methods if one.admits(m, parents))
                # The default methods differ in ordering only, so one object needs just the first.
                methods += suiting[:1] if one.by_default and len(parents) == 1 else suiting
        plan = dataclasses.replace(self, target=self.target or name, methods=methods)
        of = find_adapter(plan.target or name).target
        # Where defaults differ between filters, each filter uses its own.
        filled = [options_of(o) for o in (of.options, *(f.options for f in plan._filters()))]
        defaults = {
            n: (option.default,)
            for n, option in plan._options(of).items()
            if all(its[n].default == option.default for its in filled if n in its)
        }
        told = {name: (value,) for name, value in implied(of.options, plan.grid).items()}
        return dataclasses.replace(plan, grid={**defaults, **plan.grid, **told})

    def asked(self) -> dict[str, Any]:
        """Everything that determines the results except the number of runs, as JSON values.

        Raises:
            InputError: a file of ``tracks`` cannot be read.
        """
        return {
            "scene": describe_scene(self.scene),
            "target": self.target,
            "methods": _plain(self.methods),
            "orders": _plain(self.orders),
            "swaps": list(self.swaps),
            "grid": _plain(self.grid),
            "seed": self.seed,
            "tracks": {name: _fingerprint(path) for name, path in self.tracks.items()},
            "trackers": {name: _identity(made) for name, made in self.trackers.items()},
        }

    def configurations(
        self, start: Start, settle: Callable[[Target, Any, int], Any]
    ) -> list[Configuration]:
        """All configurations of the built-in methods; call it on the result of ``for_target``.

        Args:
            start: initial state of the objects.
            settle: function from (target, its options, particles) to the options with every
                "auto" resolved.

        Raises:
            InputError: an order is not a permutation of the objects; options are incompatible.
        """
        assert self.target is not None  # by for_target
        of = find_adapter(self.target).target
        asked = {"order": self.orders, "swap": self.swaps}
        settled: dict[Any, Any] = {}
        found: dict[str, Configuration] = {}
        for point in self._points():
            for method in self.methods or ():
                its = filters.filter_of(method)
                declared = options_of(of.options, its.options)
                counts = _counting(its, method)
                own = {n: v for n, v in point.items() if n in declared and counts.get(n, True)}
                for name, option in options_of(its.options).items():
                    if name not in its.varied:
                        own.setdefault(name, option.default)
                model = chosen(of.options, own)
                asked_for = [n for n in (own["particles"], *self.grid.get("particles", ())) if n]
                key = (model, max(asked_for, default=1))
                if key not in settled:
                    settled[key] = settle(of, model, key[1])
                parameters = {n: getattr(settled[key], n, own[n]) for n in own}
                for variant in its.variants(method, start.parents, asked):
                    its.check(chosen(its.options, parameters | variant.values), start.parents)
                    one = Configuration(method.upper(), variant.label, parameters, variant.values)
                    found.setdefault(repr(one), one)
        return list(found.values())

    def _points(self) -> Iterable[dict[str, Any]]:
        """Every point of the grid; options that force recompilation vary slowest."""
        options = self._options(self._targets()[0])
        names = sorted(options, key=lambda name: options[name].compiles)
        names = [name for name in names if name in self.grid]
        loops = list(reversed(names))
        for values in itertools.product(*(self.grid[name] for name in loops)):
            point = dict(zip(loops, values, strict=True))
            yield {name: point[name] for name in names}


def _methods_with(option: str) -> set[str]:
    """The methods whose variants set an option, such as "order"."""
    asked = {"order": ("given",), "swap": ("combinatorial",)}
    return {
        method
        for filter_ in filters.all_filters().values()
        for method in filter_.methods
        if any(option in variant.values for variant in filter_.variants(method, (-1,), asked))
    }


def _counting(its: Filter, method: str) -> dict[str, bool]:
    """Option name -> whether the option applies to one of the filter's methods."""
    return counting(its.options(method=method))


@dataclasses.dataclass(frozen=True)
class Limits:
    """Limits on the division of runs into batches; results do not depend on them.

    A batch is written as a whole, so an interrupted process loses at most one batch: about 15
    seconds of work, or less if memory is short.

    Attributes:
        memory: bytes that a batch may use while it is computed.
        runs_per_batch: fixed runs per batch instead, rounded up to whole compiled batches.
        workers: number of processes; runs are divided into at least that many batches.
        devices: per process, so that a batch keeps all of them busy; by default as many as this
            process has.
    """

    memory: int = 256 * 2**20
    runs_per_batch: int | None = None
    workers: int = 1
    devices: int | None = None

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if value is not None and value < 1:
                raise InputError(Argument(field.name, value), " must be at least 1.")


DEFAULT_LIMITS = Limits()


def describe_scene(scene: Any) -> dict[str, Any]:
    """Describe a scene, or the function that opens it, as JSON values."""
    if isinstance(scene, functools.partial):
        return {
            **describe_scene(scene.func),
            **({"arguments": [_plain(value) for value in scene.args]} if scene.args else {}),
            **{name: _plain(value) for name, value in scene.keywords.items()},
        }
    if callable(scene):
        name = getattr(scene, "__qualname__", type(scene).__qualname__)
        return {"function": f"{scene.__module__}.{name}"}
    return {"name": scene.name, "parameters": _plain(scene.parameters)}


def _plain(value: Any) -> Any:
    """Convert a value to its form after a round trip through JSON."""
    if isinstance(value, Mapping):
        return {str(name): _plain(entry) for name, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(entry) for entry in value]
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if value is None or isinstance(value, bool | int | float | str):
        return value
    return repr(value)


def _fingerprint(path: str | os.PathLike[str]) -> dict[str, str]:
    with report_os_errors("read", path):
        content = Path(path).read_bytes()
    return {"file": os.fspath(path), "sha256": hashlib.sha256(content).hexdigest()}


def _identity(function: Any) -> dict[str, Any]:
    """Describe a user's function, with the digest of its source if it has one."""
    digest = getattr(function, "sha256", None)
    return describe_scene(function) | ({"sha256": digest} if digest else {})


def _allowed(options: Sequence[Option], value: Any) -> Any:
    """Return the value in normal form if any of the options allows it."""
    for one in options[1:]:
        with contextlib.suppress(InputError):
            return one.checked(value)
    return options[0].checked(value)


def _order(value: Any) -> Any:
    if value in ("given", "shifts"):
        return value
    entries = () if isinstance(value, str) else tuple(value)
    if not entries or not all(isinstance(entry, int) for entry in entries):
        raise InputError(
            Argument("orders", repr(value), ": "),
            " is no order; give 'given', 'shifts', or the objects by their place, such as "
            "(2, 0, 1).",
        )
    return entries
