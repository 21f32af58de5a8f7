"""Checkpoints: an interrupted descent resumes and reaches the same values."""

import dataclasses
import itertools
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jaxpf import __version__
from jaxpf.files.states import digest
from jaxpf.files.store import Store
from jaxpf.tuning.parameters import Parameter
from jaxpf.tuning.problem import TrainingSequence
from jaxpf.tuning.result import Descent
from jaxpf.tuning.settings import Settings

if TYPE_CHECKING:
    from jax.typing import ArrayLike

#: Name of the checkpoint in the folder's store.
_PIECE = "checkpoint"
NAME = f"{_PIECE}.npz"
#: Fields of a descent that are stored under their own names.
_TRACES = ("loss", "gradient_norm", "stopped")


def asked(
    wanted: Sequence[Parameter],
    start: "Mapping[str, ArrayLike]",
    objective: Any,
    settings: Settings,
    sequences: Sequence[TrainingSequence],
) -> dict[str, Any]:
    """Everything that determines the tuned values, as JSON values."""
    name = objective if isinstance(objective, str) else getattr(objective, "__qualname__", "own")
    description = {
        "jaxpf": __version__,
        "parameters": [f"{p.path}={p.low:g}:{p.high:g}" for p in wanted],
        "start": {path: np.asarray(value).tolist() for path, value in start.items()},
        "objective": name,
        "sequences": [sequence.name for sequence in sequences],
        **dataclasses.asdict(settings),
        "frames": [digest((each.frames, each.observed, each.inputs)) for each in sequences],
        "labels": [digest(sequence.truth) for sequence in sequences],
        "tracker": [digest(sequence.tracker) for sequence in sequences],
    }
    return json.loads(json.dumps(description))


class Checkpoint:
    """The checkpoint of a folder."""

    def __init__(self, folder: Path, description: dict[str, Any]):
        self.pieces = Store(folder, "remove it, or choose another folder")
        self.description = description

    def write(self, descents: Sequence[Descent]) -> None:
        """Write the checkpoint atomically."""
        arrays: dict[str, Any] = {"asked": json.dumps(self.description)}
        for place, descent in enumerate(descents):
            arrays |= {f"{place}.free.{name}": z for name, z in descent.free.items()}
            arrays |= {f"{place}.moment.{i}": x for i, x in enumerate(descent.moments)}
            arrays |= {f"{place}.{name}": getattr(descent, name) for name in _TRACES}
        self.pieces.write(_PIECE, arrays)

    def read(self) -> list[Descent]:
        """Read the stored descents, if any; refuse a damaged checkpoint or one of another call."""
        if not self.pieces.path(_PIECE).exists():
            return []
        with self.pieces.opened(_PIECE) as arrays:
            old = dict(json.loads(str(arrays["asked"])))
            places = itertools.takewhile(lambda i: f"{i}.loss" in arrays, itertools.count())
            descents = [_descent(place, arrays) for place in places]
        self.pieces.check_same(old, self.description)
        return descents


def _descent(place: int, arrays: Mapping[str, np.ndarray]) -> Descent:
    free, moment = f"{place}.free.", f"{place}.moment."
    loss, gradient_norm, stopped = (arrays[f"{place}.{name}"] for name in _TRACES)
    return Descent(
        repeat=place,
        free={name.removeprefix(free): arrays[name] for name in arrays if name.startswith(free)},
        loss=loss,
        gradient_norm=gradient_norm,
        moments=[arrays[name] for name in arrays if name.startswith(moment)],
        stopped=str(stopped),
    )
