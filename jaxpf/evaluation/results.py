"""Reading the results of an evaluation, finished or not."""

import dataclasses
import os
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from jaxpf.contract.errors import InputError
from jaxpf.contract.options import chosen
from jaxpf.evaluation.work.batches import Batch, batch_files, read_batch, read_runs
from jaxpf.files.store import SETTINGS, Store
from jaxpf.targets import find_adapter
from jaxpf.targets.adapter import Adapter
from jaxpf.targets.target import Start, Target

#: The piece that holds the truth.
TRUTH = "truth"
_REMEDY = "evaluate into another folder"
_KEYS = {"versions", "asked", "runs", "float64", "scene", "configurations"}
#: Kinds of configurations.
BUILT_IN, OWN, IMPORTED = "built in", "own", "imported"


def _tuples(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _tuples(entry) for name, entry in value.items()}
    return tuple(map(_tuples, value)) if isinstance(value, list) else value


@dataclasses.dataclass(frozen=True)
class Configuration:
    """One method with one ordering and one setting of the parameters.

    Attributes:
        method: "SIR", "PS", "DPS" or "SPS", or the name of a user's tracker or imported tracks.
        ordering: objects in the order of PS counted from 1, such as "2345671" ("2-3-...-1"
            for ten objects and more), "shifts" for DPS, the swap rule for SPS, otherwise "".
        parameters: every option of the grid (sharpness, particles, scale, ...), varied or
            not; empty where the method is not built in.
        variant: values of the options that make the ordering, such as {"order": (1, 2, 0)}.
        kind: "built in"; "own" for a user's tracker; "imported" for boxes that are known and do
            not vary from run to run.
    """

    method: str
    ordering: str = ""
    parameters: dict[str, Any] = dataclasses.field(default_factory=dict)
    variant: dict[str, Any] = dataclasses.field(default_factory=dict)
    kind: str = BUILT_IN

    @classmethod
    def from_json(cls, entry: Mapping[str, Any]) -> "Configuration":
        """What ``dataclasses.asdict`` became in a JSON file: lists are tuples again."""
        return cls(**{name: _tuples(value) for name, value in entry.items()})

    @property
    def label(self) -> str:
        """Method and ordering, for tables and legends."""
        return f"{self.method} {self.ordering}".strip()

    @property
    def is_imported(self) -> bool:
        """Whether these are boxes of one run, from elsewhere."""
        return self.kind == IMPORTED


class Results:
    """What an evaluation left in its folder: configurations, truth, and batches of runs.

    Make one with ``Results.open(folder)``; ``jaxpf.evaluation.evaluate`` returns one.
    Batches are read when they are asked for, so memory does not grow with the runs.
    """

    def __init__(
        self,
        folder: Path,
        settings: dict[str, Any],
        truth: np.ndarray,
        start: Start,
        load_scene: Callable[[], Any] | None = None,
    ):
        self.folder = folder
        self.settings = settings
        self.truth = truth
        self.start = start
        self._load_scene = load_scene

    @classmethod
    def open(
        cls, folder: str | os.PathLike[str], load_scene: Callable[[], Any] | None = None
    ) -> "Results":
        """Open the folder of an evaluation.

        Args:
            folder: where the evaluation was written.
            load_scene: function that opens the evaluation's scene, for ``scene()``.

        Raises:
            InputError: no evaluation there, or one that cannot be read.
        """
        folder = Path(folder)
        settings = read_settings(folder)
        with Store(folder, _REMEDY).opened(TRUTH) as content:
            truth, shapes, sizes = (content[name] for name in ("truth", "start", "sizes"))
        scene = settings["scene"]
        try:
            start = Start(np.array(scene["object_ids"]), shapes, sizes, tuple(scene["parents"]))
        except (KeyError, TypeError, ValueError, OverflowError):
            raise InputError(
                f"'{folder / SETTINGS}' describes no evaluation; evaluate into another folder."
            ) from None
        return cls(folder, settings, truth, start, load_scene)

    @property
    def adapter(self) -> Adapter:
        """How what the scene's objects are is written and drawn."""
        return find_adapter(self.settings["scene"]["target"])

    @property
    def target(self) -> Target:
        """What the scene's objects are."""
        return self.adapter.target

    @property
    def scene_name(self) -> str:
        """What the scene is called."""
        return self.settings["scene"]["name"]

    @property
    def object_ids(self) -> tuple[int, ...]:
        """The number by which the truth knows each of the P objects."""
        return tuple(self.settings["scene"]["object_ids"])

    @property
    def start_frame(self) -> int:
        """The frame of the source, from 0, in which trackers start; T counts those after it."""
        return self.settings["scene"]["start_frame"]

    @property
    def fps(self) -> float:
        """Frames per second."""
        return self.settings["scene"]["fps"]

    @property
    def runs(self) -> int:
        """Runs that were asked for, per configuration."""
        return self.settings["runs"]

    @property
    def seed(self) -> int:
        """The seed of all runs."""
        return self.settings["asked"]["seed"]

    @property
    def configurations(self) -> list[Configuration]:
        """All configurations, those of one setting of the parameters together."""
        return [Configuration.from_json(entry) for entry in self.settings["configurations"]]

    @property
    def varied(self) -> tuple[str, ...]:
        """Names of the parameters that differ between configurations.

        Those of which one value was asked differ only by what others make of it, such as the
        motion that goes with an appearance, and are left out.
        """
        ours = [c.parameters for c in self.configurations if c.kind == BUILT_IN]
        names = dict.fromkeys(name for parameters in ours for name in parameters)
        asked = self.settings["asked"].get("grid", {})
        named = [name for name in names if len(asked.get(name, ())) != 1]
        return tuple(n for n in named if len({repr(p[n]) for p in ours if n in p}) > 1)

    def noise_scale(self, configuration: Configuration) -> np.ndarray:
        """``[3]``: process noise of the first coordinates; NaN where it is not known."""
        if configuration.kind != BUILT_IN:
            return np.full(3, np.nan)
        options = chosen(self.target.options, configuration.parameters)
        return self.target.noise(options, self.start)

    def finished(self, configuration: Configuration) -> int:
        """Number of runs of a configuration that are on disk."""
        paths = batch_files(self.folder, self._index(configuration))
        return sum(len(read_runs(path)) for path in paths)

    def batches(self, configuration: Configuration) -> Iterator[Batch]:
        """Finished runs of a configuration, in the order of the runs.

        Raises:
            InputError: a configuration that is not of this evaluation; a damaged batch.
        """
        for path in batch_files(self.folder, self._index(configuration)):
            yield read_batch(path)

    def _index(self, configuration: Configuration) -> int:
        configurations = self.configurations
        if configuration not in configurations:
            raise InputError(
                f"'{self.folder}' has no configuration {configuration.label!r} with "
                f"{configuration.parameters}; take one of its `configurations`."
            )
        return configurations.index(configuration)

    def scene(self) -> Any:
        """The scene, opened anew.

        Raises:
            InputError: these results were opened without ``load_scene``.
        """
        if self._load_scene is None:
            raise InputError(
                f"the results '{self.folder}' were opened without a way to open their scene; use "
                "Results.open(folder, load_scene=...)."
            )
        return self._load_scene()


def read_settings(folder: Path) -> dict[str, Any]:
    """``settings.json`` of an evaluation.

    Raises:
        InputError: it is missing or damaged.
    """
    path = folder / SETTINGS
    settings = Store(folder, _REMEDY).settings()
    if settings is None:
        raise InputError(f"'{folder}' holds no evaluation: '{path}' is missing.")
    if not isinstance(settings, dict) or not settings.keys() >= _KEYS:
        raise InputError(f"'{path}' describes no evaluation; {_REMEDY}.")
    return settings
