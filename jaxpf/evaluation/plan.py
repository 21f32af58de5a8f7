"""What an evaluation is to compare: methods, orderings, a grid of parameters, and runs.

Nothing here imports JAX: whether a finished evaluation is the one that is asked for can be
told in a moment.
"""

import dataclasses
import functools
import hashlib
import itertools
import math
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from jaxpf.errors import InputError
from jaxpf.evaluation.results import Configuration
from jaxpf.files.writing import report_os_errors

METHODS = ("sir", "ps", "dps", "sps")
SWAPS = ("none", "random", "sorted", "combinatorial")
SCHEMES = ("systematic", "stratified", "multinomial", "residual")
LIKELIHOODS = ("auto", "integral", "sampled")

#: ``Plan.orders``: PS in every circular shift of the objects, each a configuration of its own.
SHIFTS = "shifts"
DEFAULT_SCALE = (4.0, 2.0, 0.003)

_MOST = 2**31
#: Grid parameters in the order of loops, outermost first: those that compile anew come first.
_GRID = ("likelihood", "parts", "resampling", "particles", "scale", "sharpness")


@dataclasses.dataclass(frozen=True)
class Plan:
    """Methods x orderings x grid of parameters x runs, on one scene.

    Attributes:
        scene: what ``scenes.open_scene`` returns, or a function without arguments that
            returns it.  For worker processes the function must be picklable, such as
            ``functools.partial(load, source="distracter", seed=0)`` of a function of a module:
            every worker then opens the scene itself, once.
        methods: of ``METHODS``.
        orders: for "ps": "shifts", or permutations such as "3,1,2" that name the objects by
            their place, from 1.
        swaps: for "sps", of ``SWAPS``.
        sharpness: of the likelihood, exp(-sharpness d^2).
        particles: numbers of particles.
        scale: noise per frame of u, v (pixels) and of the relative size, three numbers each.
        resampling: of ``SCHEMES``.
        parts: horizontal bands of a box, each with its own colour histogram.
        likelihood: of ``LIKELIHOODS``; "auto" is decided once for the whole plan.
        runs: independent runs per configuration.
        seed: of all runs.  Run r of every configuration has the key ``fold_in(key(seed), r)``.
        tracks: other trackers' results, name -> MOT file or CSV with the header
            ``frame,id,x,y,w,h``; they enter the tables as one run each.

    Raises:
        InputError: a value that is out of range or named twice.
    """

    scene: Any
    methods: Sequence[str] = METHODS
    orders: Sequence[str] = (SHIFTS,)
    swaps: Sequence[str] = ("combinatorial",)
    sharpness: Sequence[float] = (20.0,)
    particles: Sequence[int] = (300,)
    scale: Sequence[Sequence[float]] = (DEFAULT_SCALE,)
    resampling: Sequence[str] = ("systematic",)
    parts: Sequence[int] = (2,)
    likelihood: Sequence[str] = ("auto",)
    runs: int = 50
    seed: int = 0
    tracks: Mapping[str, str | os.PathLike[str]] = dataclasses.field(default_factory=dict)

    def __post_init__(self) -> None:
        for name, valid in (
            ("methods", METHODS),
            ("swaps", SWAPS),
            ("resampling", SCHEMES),
            ("likelihood", LIKELIHOODS),
        ):
            self._keep(name, [_named(name, value, valid) for value in getattr(self, name)])
        if not self.tracks and not self.methods:
            raise InputError(f"methods names none; choose among {', '.join(METHODS)}.")
        self._keep("orders", [_order(value) for value in self.orders])
        self._keep("sharpness", [_positive("sharpness", value) for value in self.sharpness])
        self._keep("particles", [_whole("particles", value, 1) for value in self.particles])
        self._keep("parts", [_whole("parts", value, 1) for value in self.parts])
        self._keep("scale", [_three(value) for value in self.scale])
        object.__setattr__(self, "runs", _whole("runs", self.runs, 1))
        object.__setattr__(self, "seed", _whole("seed", self.seed, 0, 2**32))
        for name in self.tracks:
            if not name or name.upper() in map(str.upper, METHODS):
                raise InputError(
                    f"tracks cannot be called {name!r}; give them a name that is none of "
                    f"{', '.join(METHODS)}."
                )

    def _keep(self, name: str, values: list[Any]) -> None:
        """Store the normal form of a list, which has entries, each once."""
        if not values and name != "methods":
            raise InputError(f"{name} is empty; give at least one value.")
        for index, value in enumerate(values):
            if value in values[:index]:
                raise InputError(f"{name} names {_shown(value)} twice; name each value once.")
        object.__setattr__(self, name, tuple(values))

    def asked(self) -> dict[str, Any]:
        """Everything that results depend on but the number of runs, fit for JSON.

        Raises:
            InputError: a file of ``tracks`` cannot be read.
        """
        return {
            "scene": describe_scene(self.scene),
            "methods": list(self.methods),
            "orders": list(self.orders),
            "swaps": list(self.swaps),
            "sharpness": list(self.sharpness),
            "particles": list(self.particles),
            "scale": [list(value) for value in self.scale],
            "resampling": list(self.resampling),
            "parts": list(self.parts),
            "likelihood": list(self.likelihood),
            "seed": self.seed,
            "tracks": {name: _fingerprint(path) for name, path in self.tracks.items()},
        }

    def configurations(
        self, num_objects: int, choose_likelihood: Callable[[], str]
    ) -> list[Configuration]:
        """All configurations for a scene with ``num_objects``, imported tracks last.

        Args:
            num_objects: P.
            choose_likelihood: tells what "auto" stands for; asked at most once.

        Raises:
            InputError: an order that is no permutation of the objects; fewer particles than
                the components of DPS.
        """
        orders = self._orders(num_objects) if "ps" in self.methods else []
        fewest = min(self.particles)
        if "dps" in self.methods and fewest < num_objects:
            raise InputError(
                f"particles = {fewest} is fewer than the {num_objects} components of dps, one per "
                f"object; give at least {num_objects}, better some hundreds."
            )
        likelihoods = [
            choose_likelihood() if value == "auto" else value for value in self.likelihood
        ]
        values = {name: list(getattr(self, name)) for name in _GRID}
        values["likelihood"] = list(dict.fromkeys(likelihoods))
        values["scale"] = [",".join(map(_number, value)) for value in self.scale]
        orderings = {
            "sir": [""],
            "ps": orders,
            "dps": [SHIFTS],
            "sps": list(self.swaps),
        }
        found = []
        for point in itertools.product(*values.values()):
            chosen = dict(zip(values, point, strict=True))
            parameters = {name: chosen[name] for name in reversed(_GRID)}
            for method in self.methods:
                for ordering in orderings[method]:
                    found.append(Configuration(method.upper(), ordering, parameters))
        return found + [Configuration(name) for name in self.tracks]

    def _orders(self, num_objects: int) -> list[str]:
        found: list[str] = []
        for order in self.orders:
            if order == SHIFTS:
                places = [*range(1, num_objects + 1)]
                found += [
                    order_label(places[shift:] + places[:shift]) for shift in range(num_objects)
                ]
                continue
            entries = [int(entry) for entry in order.split(",")]
            if sorted(entries) != list(range(1, num_objects + 1)):
                raise InputError(
                    f"orders: {order!r} is not a permutation of the {num_objects} object(s); name "
                    f"each of 1 to {num_objects} once."
                )
            found.append(order_label(entries))
        return list(dict.fromkeys(found))


@dataclasses.dataclass(frozen=True)
class Limits:
    """How runs are divided into batches, which has no influence on results.

    A batch is what is written at once, and what a kill can cost: some 15 seconds of work, or
    less to keep within the memory.

    Attributes:
        memory: bytes that a batch may take while it is computed.
        runs_per_batch: instead, runs per batch, rounded up to whole compiled batches.
        workers: processes among which to divide the runs at least.
        devices: of each process, so that a batch has work for all; by default as many as this
            process has.

    Raises:
        InputError: a number below 1.
    """

    memory: int = 256 * 2**20
    runs_per_batch: int | None = None
    workers: int = 1
    devices: int | None = None

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if value is not None and value < 1:
                raise InputError(f"{field.name} = {value} must be at least 1.")


DEFAULT_LIMITS = Limits()


def order_label(places: Sequence[int]) -> str:
    """An order of objects counted from 1: "3,1,2" as "312", with hyphens from ten objects on."""
    return ("" if len(places) < 10 else "-").join(map(str, places))


def order_of_label(label: str) -> list[int]:
    """The order that ``order_label`` wrote, counted from 0."""
    return [int(place) - 1 for place in (label.split("-") if "-" in label else label)]


def describe_scene(scene: Any) -> dict[str, Any]:
    """A scene, or the function that opens it, in words that JSON can hold."""
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


def differences(old: Mapping[str, Any], new: Mapping[str, Any]) -> Iterable[str]:
    """What changed between two ``asked()``, as "name = old, now new"."""
    for name in dict.fromkeys([*old, *new]):
        before, after = old.get(name), new.get(name)
        if before == after:
            continue
        if isinstance(before, Mapping) and isinstance(after, Mapping):
            yield from (f"{name}: {change}" for change in differences(before, after))
        else:
            yield f"{name} = {_shown(before)}, now {_shown(after)}"


def _plain(value: Any) -> Any:
    """A value as JSON would give it back."""
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


def _shown(value: Any) -> str:
    if isinstance(value, list | tuple):
        return ",".join(map(_shown, value)) or "none"
    if isinstance(value, Mapping):
        return f"{{{', '.join(f'{name}: {_shown(entry)}' for name, entry in value.items())}}}"
    if isinstance(value, float):
        return _number(value)
    return "nothing" if value is None else str(value)


def _number(value: float) -> str:
    """The shortest text that gives the number back, without a needless ".0"."""
    text = f"{value:g}"
    return text if float(text) == value else repr(value)


def _named(name: str, value: Any, valid: Sequence[str]) -> str:
    if value not in valid:
        raise InputError(f"{name}: {value!r} is unknown; choose among {', '.join(valid)}.")
    return value


def _order(value: str | Sequence[int]) -> str:
    text = value if isinstance(value, str) else ",".join(map(str, value))
    if text == SHIFTS:
        return text
    entries = text.split(",")
    if not all(entry.strip().isdecimal() for entry in entries):
        raise InputError(
            f"orders: {text!r} is no order; write {SHIFTS!r}, or the objects by their place from "
            "1, such as 3,1,2."
        )
    return ",".join(str(int(entry)) for entry in entries)


def _whole(name: str, value: Any, least: int, bound: int = _MOST) -> int:
    whole = isinstance(value, int) and not isinstance(value, bool)
    if not whole or not least <= value < bound:
        raise InputError(f"{name} = {value} must be a whole number from {least} to {bound - 1}.")
    return int(value)


def _positive(name: str, value: Any) -> float:
    if not isinstance(value, int | float) or not 0 < value < math.inf:
        raise InputError(f"{name} = {value} must be positive and finite.")
    return float(value)


def _three(value: Sequence[float]) -> tuple[float, ...]:
    numbers = tuple(float(number) for number in value)
    if len(numbers) != 3 or not all(0 <= number < math.inf for number in numbers):
        raise InputError(
            f"scale = {','.join(map(_number, numbers))} must be three finite numbers >= 0: the "
            "noise of x and y in pixels and of the relative size, such as 4,2,0.003."
        )
    return numbers
