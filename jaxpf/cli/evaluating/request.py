"""What ``jaxpf evaluate`` is asked: its options, the request, and the library's plan of it."""

import dataclasses
import functools
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

from jaxpf.cli.shared import flags
from jaxpf.cli.shared.flags import as_typed, given_in, pair
from jaxpf.cli.shared.scene_options import (
    SceneOptions,
    names_in,
    resolved_scene,
    scene_name,
    scene_parameters,
)
from jaxpf.contract.errors import InputError
from jaxpf.contract.options import Option, options_of
from jaxpf.evaluation import Plan
from jaxpf.evaluation.baselines.rivals import available, baselines
from jaxpf.evaluation.scene import load_scene
from jaxpf.evaluation.trackers import OwnTracker
from jaxpf.filters import registry
from jaxpf.filters.registry import GIVEN, ORDERS, SHIFTS, all_filters
from jaxpf.targets.registry import all_targets

#: Options that choose output or computing resources and do not affect results.
_NOT_REPEATED = ("output", "dry_run", "dask", "speed")
#: Filter options with their own flags here, shared by all variants.
VARIED = ("method", "order", "swap")
#: Value of --baseline for all baselines that are installed.
_ALL = "all"
#: Maximum number of processes, and of host devices per process, which JAX sets up one by one.
_MOST = 256


@dataclasses.dataclass(frozen=True)
class Compared:
    """Options that choose what to compare, except those of targets and filters."""

    methods: Annotated[
        str | None,
        Option(
            f"Comma-separated: {', '.join(registry.methods())}.  `jaxpf track --help` explains "
            "them; by default sir, ps, dps and sps, if they suit the scene, and only sir for one "
            "object."
        ),
    ] = None
    orders: Annotated[
        tuple[str, ...],
        Option(
            f"Orders of ps, repeatable: {GIVEN} (the scene's), {SHIFTS} (all circular shifts), or "
            "the objects by their place from 1, such as 3,1,2.",
            length=-1,
        ),
    ] = (GIVEN,)
    swaps: Annotated[str, Option("How sps exchanges parts between particles.")] = "combinatorial"
    tracks: Annotated[
        tuple[str, ...],
        Option(
            "NAME=FILE, another tracker's results, repeatable.  In MOT format or with the header "
            "frame,id,x,y,w,h."
        ),
    ] = ()
    tracker: Annotated[
        tuple[str, ...],
        Option(
            "[NAME=]FILE.py:FUNCTION, a tracker of your own, repeatable.  The function takes the "
            "scene and returns a tracker or boxes [T, P, 4]."
        ),
    ] = ()
    baseline: Annotated[
        tuple[str, ...],
        Option(
            "Baselines, comma-separated: mil, csrt, kcf, dlib, meanshift, still, all; points: "
            "spot, flow.  Boxes of still do not move; csrt and kcf need opencv-contrib, dlib "
            "dlib-bin; all takes those installed for boxes.  vit:NET.onnx and "
            "nano:BACKBONE.onnx:NECKHEAD.onnx are OpenCV's networks, with model files of yours.  "
            "spot: Zhang and van der Maaten 2013; flow: optical flow (points only)."
        ),
    ] = ()


@dataclasses.dataclass(frozen=True)
class Work:
    """Options that choose the number of runs and where they run."""

    runs: Annotated[int, Option("Runs per configuration.")] = 50
    seed: Annotated[int, Option("Seed of all runs.")] = 0
    workers: Annotated[int, Option("Processes that share the work.", least=1, most=_MOST)] = 1
    dask: Annotated[str | None, Option("Dask scheduler, such as tcp://127.0.0.1:8786.")] = None
    devices: Annotated[
        int | None,
        Option(
            "Host devices per process; by default the processes share all cores.",
            least=1,
            most=_MOST,
        ),
    ] = None
    output: Annotated[
        Path | None,
        Option(
            "Folder for the results; the same command resumes from it.  [default: jaxpf-NAME]",
            flags=("-o",),
        ),
    ] = None
    speed: Annotated[
        bool,
        Option(
            "Also measure each method's speed in a single run, in frames per second (compiles "
            "again)."
        ),
    ] = False
    dry_run: Annotated[bool, Option("Show the plan only.")] = False


@dataclasses.dataclass(frozen=True)
class Options(Work, Compared, SceneOptions):
    """Options of ``jaxpf evaluate`` for any target and filter."""


@dataclasses.dataclass(frozen=True)
class Request:
    """A comparison.

    Attributes:
        scene: scene name or absolute path.
        options: values of ``Options``, with absolute file paths.
        grid: given options of targets and filters -> value on the command line.
        plan: the library's plan of it, ``jaxpf.evaluation.Plan``.
    """

    scene: str
    options: Options
    grid: Mapping[str, Any]
    plan: Plan

    @property
    def output(self) -> Path:
        """The folder for the results."""
        return self.options.output or Path(f"jaxpf-{scene_name(self.scene)}")

    @property
    def varied(self) -> list[str]:
        """Options of the grid that have several values."""
        return [name for name, values in self.plan.grid.items() if len(values) > 1]

    def table(self) -> dict[str, Any]:
        """Contents of ``run.toml``, in command-line notation."""
        kept = {
            n: v for n, v in as_typed(vars(self.options), Options).items() if n not in _NOT_REPEATED
        }
        return {"scene": self.scene, **kept, **self.grid}

    def of_sequence(self, folder: Path, target: str | None, frames: int | None) -> "Request":
        """The same request for one of several sequences, into a folder of its own."""
        options = dataclasses.replace(
            self.options, target=target, frames=frames, output=self.output / folder.name
        )
        load: Any = self.plan.scene
        scene = functools.partial(load, source=str(folder), num_frames=frames)
        plan = dataclasses.replace(self.plan, scene=scene, target=target)
        return dataclasses.replace(self, scene=str(folder), options=options, plan=plan)


def parse(values: Mapping[str, Any]) -> Request:
    """Parse the values of all flags.

    Raises:
        InputError: a value is out of range, or a name occurs twice.
    """
    options = Options(**flags.parse(values, Options))
    if options.dask and options.workers > 1:
        raise InputError(
            f"--dask brings workers of its own; leave it or --workers {options.workers} out."
        )
    if not all(map(names_in, options.baseline)):
        raise InputError("--baseline names none; leave it out, or name one, such as still.")
    tracks = _by_name(
        "--tracks", [pair("--tracks", text, os.path.realpath) for text in options.tracks]
    )
    places = _by_name("--tracker", [_own(text) for text in options.tracker])
    named = [name for text in options.baseline for name in names_in(text)]
    named = list(dict.fromkeys(available() if _ALL in named else named))
    rivals = baselines(named)
    for name in rivals.keys() & places.keys():
        raise InputError(f"--tracker {name!r} is the name of a baseline; give it another one.")
    options = dataclasses.replace(
        options,
        tracks=tuple(f"{name}={path}" for name, path in tracks.items()),
        tracker=tuple(f"{name}={place}" for name, place in places.items()),
        baseline=tuple(named),
    )
    owners: list[Any] = [target.tracker for target in all_targets().values()]
    declared = options_of(*owners, *(each.build for each in all_filters().values()))
    given = given_in(values)
    grid = {name: given[name] for name in declared if name in given and name not in VARIED}
    scene = resolved_scene(values["scene"])
    plan = Plan(
        scene=functools.partial(
            load_scene,
            source=scene,
            seed=options.scene_seed,
            ids=None if options.ids is None else list(options.ids),
            start_frame=options.start_frame,
            num_frames=options.frames,
            parameters=scene_parameters(options.set),
        ),
        methods=None if options.methods is None else names_in(options.methods),
        orders=[_order(text) for text in options.orders],
        swaps=names_in(options.swaps),
        grid={name: _values(value) for name, value in grid.items()},
        target=options.target,
        runs=options.runs,
        seed=options.seed,
        tracks=tracks,
        trackers={**{name: OwnTracker.read(each) for name, each in places.items()}, **rivals},
    )
    return Request(scene, options, grid, plan)


def _by_name(flag: str, pairs: Sequence[tuple[str, str]]) -> dict[str, str]:
    if len(named := dict(pairs)) < len(pairs):
        raise InputError(f"{flag} gives a name twice; give each file a name of its own.")
    return named


def _values(typed: Any) -> list[Any]:
    """Parse the values of a grid option: comma-separated names, numbers, or lists of numbers."""
    if isinstance(typed, str):
        return names_in(typed)
    entries = [typed] if isinstance(typed, bool) else typed
    return [tuple(entry) if isinstance(entry, list) else entry for entry in entries]


def _order(text: str) -> Any:
    """Convert an order from 1-based to 0-based indices."""
    if text in ORDERS:
        return text
    entries = text.split(",")
    if not all(entry.strip().isdecimal() and int(entry) > 0 for entry in entries):
        raise InputError(
            f"--orders {text!r} is not an order; write {', '.join(map(repr, ORDERS))}, or the "
            "objects by their place from 1, such as 3,1,2."
        )
    return tuple(int(entry) - 1 for entry in entries)


def _own(text: str) -> tuple[str, str]:
    """Name and absolute path of a user-defined tracker; its name defaults to the function's."""
    name, equals, place = text.partition("=")
    if not equals:
        name, place = text.rpartition(":")[2] or text, text
    path, colon, function = place.rpartition(":")
    return name, f"{os.path.realpath(path)}:{function}" if colon else place
