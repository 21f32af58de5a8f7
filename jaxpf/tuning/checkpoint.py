"""Checkpoints: a descent that was interrupted goes on where it was, to the same values."""

import dataclasses
import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import jax
import numpy as np

from jaxpf import __version__
from jaxpf.errors import InputError
from jaxpf.evaluation.plan import differences
from jaxpf.files.writing import atomic_write
from jaxpf.tuning.parameters import Parameter
from jaxpf.tuning.problem import TrainingSequence
from jaxpf.tuning.result import Descent
from jaxpf.tuning.settings import Settings

NAME = "checkpoint.npz"


def asked(
    wanted: Sequence[Parameter],
    start: Mapping[str, Any],
    objective: Any,
    settings: Settings,
    sequences: Sequence[TrainingSequence],
    label: Any,
) -> dict[str, Any]:
    """Everything that the values depend on, fit for JSON."""
    name = objective if isinstance(objective, str) else getattr(objective, "__qualname__", "own")
    description = {
        "jaxpf": __version__,
        "parameters": [f"{one.path}={one.low:g}:{one.high:g}" for one in wanted],
        "start": {path: np.asarray(value).tolist() for path, value in start.items()},
        "objective": name,
        "sequences": [sequence.name for sequence in sequences],
        "content": [_digest(sequence) for sequence in sequences],
        "label": label,
        **dataclasses.asdict(settings),
    }
    return json.loads(json.dumps(description))


def _digest(sequence: TrainingSequence) -> str:
    """Frames, labels and the tracker's numbers, so that no other picture slips in."""
    digest = hashlib.sha256(str(jax.tree.structure(sequence.tracker)).encode())
    for leaf in jax.tree.leaves((sequence.tracker, sequence.frames, sequence.truth)):
        digest.update(np.ascontiguousarray(leaf).tobytes())
    return digest.hexdigest()[:16]


class Store:
    """The checkpoint of a folder."""

    def __init__(self, folder: Path, description: dict[str, Any]):
        self.path = folder / NAME
        self.description = description

    def write(self, descents: Sequence[Descent]) -> None:
        """Write the checkpoint, completely or not at all.

        Raises:
            InputError: the folder is missing, or the disk full.
        """
        arrays: dict[str, Any] = {}
        about = []
        for place, descent in enumerate(descents):
            arrays |= {f"{place}.free.{name}": z for name, z in descent.free.items()}
            arrays |= {f"{place}.moment.{i}": x for i, x in enumerate(descent.moments)}
            arrays[f"{place}.loss"] = descent.loss
            arrays[f"{place}.gradient_norm"] = descent.gradient_norm
            about.append({"stopped": descent.stopped, "moments": len(descent.moments)})
        text = json.dumps({"asked": self.description, "descents": about})
        with atomic_write(self.path, "wb") as file:
            np.savez(file, allow_pickle=False, about=np.array(text), **arrays)

    def read(self) -> list[Descent]:
        """The descents so far; none without a checkpoint.

        Raises:
            InputError: it is damaged, or of another call.
        """
        if not self.path.exists():
            return []
        try:
            with np.load(self.path, allow_pickle=False) as content:
                arrays = dict(content)
            about = json.loads(str(arrays.pop("about")))
            descents = [self._descent(i, one, arrays) for i, one in enumerate(about["descents"])]
        except (OSError, ValueError, KeyError, EOFError) as error:
            raise InputError(
                f"the checkpoint '{self.path}' is damaged ({error}); remove it, or choose another "
                "folder."
            ) from None
        change = next(iter(differences(about["asked"], self.description)), None)
        if change is not None:
            raise InputError(
                f"'{self.path.parent}' was begun with {change}; choose another folder, or ask for "
                "the same."
            )
        return descents

    def _descent(self, place: int, about: dict[str, Any], arrays: dict[str, Any]) -> Descent:
        prefix = f"{place}.free."
        return Descent(
            repeat=place,
            free={k.removeprefix(prefix): z for k, z in arrays.items() if k.startswith(prefix)},
            loss=arrays[f"{place}.loss"],
            gradient_norm=arrays[f"{place}.gradient_norm"],
            moments=[arrays[f"{place}.moment.{i}"] for i in range(about["moments"])],
            stopped=about["stopped"],
        )
