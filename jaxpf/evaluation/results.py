"""The stored results of an evaluation, finished or not: settings, truth and batches of runs."""

import contextlib
import dataclasses
import functools
import json
import math
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from jaxpf.contract.errors import InputError
from jaxpf.contract.numbers import plain
from jaxpf.files.store import SETTINGS, Damaged, Store
from jaxpf.files.writing import report_os_errors, write_text
from jaxpf.targets.registry import find_target
from jaxpf.targets.target import Start, Target

#: Name of the stored file with the ground truth.
TRUTH = "truth"
#: Folder of the batches, the pieces of the evaluation's store.
FOLDER = "batches"
#: Name of the file with speeds, apart from the results because only those are reproducible.
SPEEDS = "speed.json"
_REMEDY = "evaluate into another folder"
_KEYS = {"versions", "asked", "runs", "float64", "scene", "configurations"}
#: Kinds of configurations.
BUILT_IN, OWN, IMPORTED = "built in", "own", "imported"


def _tuples(value: object) -> Any:
    if isinstance(value, dict):
        return {name: _tuples(entry) for name, entry in value.items()}
    return tuple(map(_tuples, value)) if isinstance(value, list) else value


@dataclasses.dataclass(frozen=True)
class Configuration:
    """One method with one ordering and one set of parameter values.

    Attributes:
        method: "SIR", "PS", "DPS" or "SPS", or the name of a user-defined tracker or of imported
            tracks.
        ordering: of PS, the order of the objects counted from 1, such as "2345671" ("2-3-...-1"
            for ten or more objects); "shifts" for DPS; the swap rule for SPS; otherwise "".
        parameters: every option of the grid (sharpness, num_particles, noise_pixels, ...), varied
            or not; empty unless the method is built in.
        variant: options that define the ordering, such as {"order": (1, 2, 0)}.
        kind: "built in"; "own" for a user-defined tracker; "imported" for given boxes, which are
            the same in every run.
    """

    method: str
    ordering: str = ""
    parameters: dict[str, Any] = dataclasses.field(default_factory=dict)
    variant: dict[str, Any] = dataclasses.field(default_factory=dict)
    kind: str = BUILT_IN

    @classmethod
    def from_json(cls, entry: Mapping[str, Any]) -> "Configuration":
        """Restore a configuration from JSON; lists become tuples."""
        return cls(**{name: _tuples(value) for name, value in entry.items()})

    @property
    def label(self) -> str:
        """Method and ordering, for tables and legends."""
        return f"{self.method} {self.ordering}".strip()

    def named(self, names: Sequence[str]) -> list[str]:
        """Those of the named parameters that the configuration has, as "sharpness 20"."""
        values = self.parameters
        return [f"{name} {plain(values[name])}" for name in names if name in values]

    @property
    def is_imported(self) -> bool:
        """Whether this is a single run of imported boxes."""
        return self.kind == IMPORTED


@dataclasses.dataclass(frozen=True)
class Batch:
    """R runs of one configuration over the T frames after the start frame.

    Measures that a tracker lacks, such as the share of distinct particles of imported
    tracks, are NaN.

    Attributes:
        seeds: ``[R]`` int64, the evaluation's seed.
        runs: ``[R]`` int64, run numbers from 0, ascending.  Seed and run number determine the
            random numbers of a run, so all methods share them.
        shapes: ``[R, T, P, S]`` float32, estimated shapes, see ``jaxpf.targets.target``; for
            boxes x, y, w, h in pixels.
        distinct_share: ``[R, T, P]`` float32, distinct draws over particles.
        spread: ``[R, T, P, D]`` float32, standard deviation of the particle set.
        model_error: ``[R, P, 3]`` float32, see ``jaxpf.contract.Likelihood``.
        confidence: ``[R, T, P]`` float32, 0 to 1, see ``jaxpf.Summary``.
        ess: ``[R, T]`` float32, effective sample size.
        log_evidence: ``[R, T]`` float32, increment per frame.
        without_likelihood: ``[R, T, P]`` bool, whether an object has zero likelihood in every
            particle; for imported tracks, whether it has no box.
    """

    seeds: np.ndarray
    runs: np.ndarray
    shapes: np.ndarray
    distinct_share: np.ndarray
    spread: np.ndarray
    model_error: np.ndarray
    confidence: np.ndarray
    ess: np.ndarray
    log_evidence: np.ndarray
    without_likelihood: np.ndarray

    def __len__(self) -> int:
        """Number of runs, R."""
        return len(self.runs)


#: Names of the arrays of a batch.
_FIELDS = tuple(field.name for field in dataclasses.fields(Batch))


def batch_name(configuration: int, first_run: int) -> str:
    """Name of a batch in the store, by the index of its configuration; they sort by their runs."""
    return f"{configuration:04d}-{first_run:08d}"


class Results:
    """The stored results of an evaluation: configurations, truth, and batches of runs.

    Use ``Results.open(folder)``; ``jaxpf.evaluation.evaluate`` also returns one.  Batches are read
    on demand, so memory does not grow with the number of runs.
    """

    def __init__(
        self,
        folder: Path,
        settings: dict[str, Any],
        truth: np.ndarray,
        start: Start,
    ):
        self.folder = folder
        self.settings = settings
        self.truth = truth
        self.start = start
        self.store = Store(folder / FOLDER, "evaluate again, which repeats its runs alone")

    @classmethod
    def open(cls, folder: str | os.PathLike[str]) -> "Results":
        """Open the folder of an evaluation.

        Raises:
            InputError: the folder holds no evaluation, or it cannot be read.
        """
        folder = Path(folder)
        settings = read_settings(folder)
        truth, shapes, sizes = (
            Store(folder, _REMEDY).read(TRUTH, "truth", "start", "sizes").values()
        )
        scene = settings["scene"]
        try:
            start = Start(np.array(scene["object_ids"]), shapes, sizes, tuple(scene["parents"]))
        except (KeyError, TypeError, ValueError, OverflowError):
            raise InputError(
                f"'{folder / SETTINGS}' describes no evaluation; evaluate into another folder."
            ) from None
        return cls(folder, settings, truth, start)

    @property
    def target(self) -> Target:
        """Type of the scene's objects."""
        return find_target(self.settings["scene"]["target"])

    @property
    def scene_name(self) -> str:
        """Name of the scene."""
        return self.settings["scene"]["name"]

    @property
    def object_ids(self) -> tuple[int, ...]:
        """Ground-truth id of each of the P objects."""
        return tuple(self.settings["scene"]["object_ids"])

    @property
    def start_frame(self) -> int:
        """Source frame, from 0, in which trackers start; the T frames come after it."""
        return self.settings["scene"]["start_frame"]

    @property
    def fps(self) -> float:
        """Frames per second."""
        return self.settings["scene"]["fps"]

    @property
    def runs(self) -> int:
        """Requested runs per configuration."""
        return self.settings["runs"]

    @property
    def seed(self) -> int:
        """The seed of all runs."""
        return self.settings["asked"]["seed"]

    @functools.cached_property
    def configurations(self) -> list[Configuration]:
        """All configurations, grouped by parameter values."""
        return [Configuration.from_json(entry) for entry in self.settings["configurations"]]

    @functools.cached_property
    def varied(self) -> tuple[str, ...]:
        """Names of the parameters that differ between configurations.

        A parameter with one requested value is left out, even if another parameter changes how
        that value is resolved (an appearance can choose the motion, for example).
        """
        ours = [c.parameters for c in self.configurations if c.kind == BUILT_IN]
        names = dict.fromkeys(name for parameters in ours for name in parameters)
        asked = self.settings["asked"].get("grid", {})
        named = [name for name in names if len(asked.get(name, ())) != 1]
        return tuple(n for n in named if len({repr(p[n]) for p in ours if n in p}) > 1)

    @property
    def swept(self) -> tuple[str, ...]:
        """The varied parameters for which several values were requested."""
        asked = self.settings["asked"].get("grid", {})
        return tuple(name for name in self.varied if len(asked.get(name, ())) > 1)

    def name_of(self, configuration: Configuration, but: Sequence[str] = ()) -> str:
        """Method, ordering, and the parameters that differ between configurations, save ``but``."""
        names = [name for name in self.varied if name not in but]
        return ", ".join([configuration.label, *configuration.named(names)])

    @property
    def speeds(self) -> list[float]:
        """Frames per second of each configuration; NaN where not measured, see ``speed``."""
        path = self.folder / SPEEDS
        if not path.is_file():
            return len(self.settings["configurations"]) * [math.nan]
        return [math.nan if x is None else x for x in json.loads(path.read_text("utf-8"))]

    def write_speeds(self, speeds: Sequence[float]) -> None:
        """Store the frames per second of each configuration; NaN where not measured."""
        rounded = [round(x, 4) if math.isfinite(x) else None for x in speeds]
        write_text(self.folder / SPEEDS, json.dumps(rounded))

    def batches(self, configuration: Configuration) -> Iterator[Batch]:
        """Yield the finished runs of a configuration in order.

        Raises:
            ValueError: the configuration is not part of this evaluation.
            InputError: a batch is damaged.
        """
        for name in self._names(self.configurations.index(configuration)):
            yield Batch(**self.store.read(name, *_FIELDS))

    def write(self, configuration: int, batch: Batch) -> None:
        """Store a batch of the configuration with an index."""
        self.store.write(batch_name(configuration, int(batch.runs[0])), vars(batch))

    def begin(self) -> None:
        """Start or resume the evaluation; settings are written last, because they mark the folder.

        Raises:
            InputError: the folder or the files cannot be written.
        """
        with report_os_errors("create the folder", self.folder):
            self.store.folder.mkdir(parents=True, exist_ok=True)
        store, start = Store(self.folder), self.start
        if not store.path(TRUTH).exists():
            arrays = {"truth": self.truth, "start": start.shapes, "sizes": start.sizes}
            store.write(TRUTH, arrays)
        store.begin(self.settings)

    def survey(self) -> tuple[list[np.ndarray], list[Path]]:
        """Read every batch to its end to find the finished runs.

        Returns:
            For each configuration ``[runs]`` bool, whether a run is finished; and the damaged
            files.
        """
        done, damaged = [], []
        for index, configuration in enumerate(self.configurations):
            finished = np.zeros(1 if configuration.is_imported else self.runs, bool)
            for name in self._names(index):
                with contextlib.suppress(Damaged):
                    batch = Batch(**self.store.read(name, *_FIELDS))
                    if batch.shapes.shape == (len(batch), *self.truth.shape):
                        finished[batch.runs[batch.runs < len(finished)]] = True
                        continue
                damaged.append(self.store.path(name))
            done.append(finished)
        return done, damaged

    def _names(self, configuration: int) -> list[str]:
        """Names of a configuration's batches, in the order of their runs."""
        return self.store.names(f"{configuration:04d}-{8 * '[0-9]'}")


def read_settings(folder: Path) -> dict[str, Any]:
    """Read ``settings.json`` of an evaluation.

    Raises:
        InputError: the file is missing or damaged.
    """
    path = folder / SETTINGS
    settings = Store(folder, _REMEDY).settings()
    if settings is None:
        raise InputError(f"'{folder}' holds no evaluation: '{path}' is missing.")
    if not isinstance(settings, dict) or not settings.keys() >= _KEYS:
        raise InputError(f"'{path}' describes no evaluation; {_REMEDY}.")
    return settings
