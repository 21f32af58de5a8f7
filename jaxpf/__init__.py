"""jaxpf: particle filters for visual tracking of many, articulated and deformable objects.

Names are imported when they are first used (PEP 562), because importing JAX takes most of
a second that ``jaxpf --help`` and a script that only reads files need not spend.
"""

import importlib
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

_MODULES = (
    "articulated",
    "boxes",
    "contract",
    "dynamics",
    "errors",
    "evaluation",
    "geometry",
    "gradients",
    "intervals",
    "joints",
    "likelihoods",
    "metrics",
    "objectives",
    "ordering",
    "overlay",
    "partitioned",
    "plotting",
    "pytree",
    "resampling",
    "running",
    "scores",
    "state",
    "track_matching",
    "tracking",
    "tracks",
    "tuning",
    "video",
    "video_writer",
)
_NAMES = {
    "InputError": "errors",
    "ParticleState": "state",
    "Partitioned": "partitioned",
    "Summary": "state",
    "monte_carlo": "running",
    "pytree_dataclass": "pytree",
    "run": "running",
    "tune": "tuning",
}

if TYPE_CHECKING:
    from jaxpf import (  # noqa: F401
        articulated,
        boxes,
        contract,
        dynamics,
        errors,
        evaluation,
        geometry,
        gradients,
        intervals,
        joints,
        likelihoods,
        metrics,
        objectives,
        ordering,
        overlay,
        partitioned,
        plotting,
        pytree,
        resampling,
        running,
        scores,
        state,
        track_matching,
        tracking,
        tracks,
        tuning,
        video,
        video_writer,
    )
    from jaxpf.errors import InputError
    from jaxpf.partitioned import Partitioned
    from jaxpf.pytree import pytree_dataclass
    from jaxpf.running import monte_carlo, run
    from jaxpf.state import ParticleState, Summary
    from jaxpf.tuning import tune

__all__ = [
    "InputError",
    "ParticleState",
    "Partitioned",
    "Summary",
    "monte_carlo",
    "pytree_dataclass",
    "run",
    "tune",
]


def __getattr__(name: str) -> Any:
    if name in _NAMES:
        return getattr(importlib.import_module(f"jaxpf.{_NAMES[name]}"), name)
    if name in _MODULES:
        return importlib.import_module(f"jaxpf.{name}")
    raise AttributeError(f"module 'jaxpf' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*__all__, *_MODULES])
