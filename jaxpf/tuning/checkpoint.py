"""Checkpoints: an interrupted descent resumes and reaches the same values.

A store in the call's folder has a piece for each repeat that has begun.
"""

import dataclasses
import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from jax.typing import ArrayLike

from jaxpf import __version__
from jaxpf.files.states import digest
from jaxpf.files.store import Store
from jaxpf.tuning.parameters import Parameter
from jaxpf.tuning.problem import TrainingSequence
from jaxpf.tuning.result import Descent
from jaxpf.tuning.settings import Settings

#: Fields of a descent that are stored under their own names.
_TRACES = ("loss", "gradient_norm", "stopped")


def asked(
    parameters: Sequence[Parameter],
    start: Mapping[str, ArrayLike],
    objective: Any,
    settings: Settings,
    sequences: Sequence[TrainingSequence],
) -> dict[str, Any]:
    """Everything that determines the tuned values, as JSON values."""
    name = objective if isinstance(objective, str) else getattr(objective, "__qualname__", "own")
    description = {
        "jaxpf": __version__,
        "parameters": [f"{p.path}={p.low:g}:{p.high:g}" for p in parameters],
        "start": {path: np.asarray(value).tolist() for path, value in start.items()},
        "objective": name,
        "sequences": [sequence.name for sequence in sequences],
        **dataclasses.asdict(settings),
        "frames": [digest((each.frames, each.observed, each.inputs)) for each in sequences],
        "labels": [digest(sequence.truth) for sequence in sequences],
        "tracker": [digest(sequence.tracker) for sequence in sequences],
    }
    return json.loads(json.dumps(description))


def write(store: Store, description: Mapping[str, Any], descent: Descent) -> None:
    """Write a descent; the first one begins the store's job."""
    if store.settings() is None:
        store.begin(description)
    arrays = {f"free.{name}": z for name, z in descent.free.items()}
    arrays |= {f"moment.{number}": x for number, x in enumerate(descent.moments)}
    arrays |= {name: np.asarray(getattr(descent, name)) for name in _TRACES}
    store.write(f"repeat-{descent.repeat}", arrays)


def read(store: Store, description: Mapping[str, Any]) -> list[Descent]:
    """Read the stored descents, if any; refuse damaged ones, or those of another call."""
    old = store.settings()
    if old is None:
        return []
    store.check_same(old, description)
    return [_descent(repeat, store) for repeat in range(len(store.names("repeat-*")))]


def _descent(repeat: int, store: Store) -> Descent:
    arrays = store.read(f"repeat-{repeat}")
    free = [name for name in arrays if name.startswith("free.")]
    moments = [name for name in arrays if name.startswith("moment.")]
    return Descent(
        repeat=repeat,
        free={name.removeprefix("free."): arrays[name] for name in free},
        loss=arrays["loss"],
        gradient_norm=arrays["gradient_norm"],
        moments=[arrays[name] for name in moments],
        stopped=str(arrays["stopped"]),
    )
