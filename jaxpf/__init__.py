"""jaxpf: particle filters for visual tracking of many, articulated and deformable objects.

The map, downwards: a file imports from its own room and from rooms below it, never from above.

``cli/``
    The command line, one file per command.
``benchmarks/``
    What things cost, one file for each.
``experiments/``
    The papers' tables and figures repeated, one folder per paper, all alike.
``evaluation/``, ``tuning/``
    Many runs compared, with intervals, resumed where interrupted; parameters found by gradient.
``adapters/``
    How a program reads, writes, draws and asks for each target: one file per target, entered here.
``files/``, ``media/``
    Tables of tracks in and out; video, drawing and plots.
``boxes``, ``parts``, ``points``, ``contours``, ``building``, ``populations/``
    Where a filter and a target's model meet: ``tracker`` makes what the command line tracks with;
    boxes that come and go.
``baselines/``
    Other trackers to compare with: OpenCV's, optical flow, SPOT, IoU; simulated detections.
``targets/``
    What a substate means, one file per target: boxes, parts, points, contours.  A target says
    where it starts, which model follows, and what it reports; no file, no flag, no filter.
``measures/``
    How good tracks are.
``smoothing/``
    Back over a clip whose every frame is known: where things were while they were hidden.
``filters/``
    How guesses are organised: ``partitioned/`` (SIR, PS, DPS, SPS and branched, one kernel),
    ``labelled/`` (each particle holds one of many targets), ``factored/`` (PFFL and eskil2014:
    every partition has particles of its own).  A tracker is a filter on a target's model; neither
    knows the other.
``models/``
    How a substate moves (``dynamics``, ``joints``) and explains a frame (``likelihoods``).
``checks``, ``contract``, ``state``, ``running/``, ``chunks``, ``streaming``
    What a tracker, a dynamics and a likelihood are; what a frame reports; over the frames.
``lowering/``
    What is written for the compiler's sake, and nothing else.
``options``, ``memory``, ``names``, ``pytree``, ``errors``
    What everything shares; an option is declared once, beside the filter or target that has it.

``scenes``, the package beside this one, makes synthetic sequences and reads annotated clips; it
imports nothing of ``jaxpf``.

Names are imported when they are first used (PEP 562), because importing JAX takes most of a
second that ``jaxpf --help`` and a script that only reads files need not spend.
"""

import importlib
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

#: Public modules; each is a file or a folder of that name.
_MODULES = (
    "boxes", "chunks", "contours", "contract", "dynamics", "errors", "evaluation", "factored",
    "geometry", "gradients", "intervals", "joints", "labelled", "likelihoods", "metrics",
    "objectives", "ordering", "overlay", "parts", "plotting", "points", "populations", "pytree",
    "relocation", "resampling", "scores", "shapes", "smoothing", "splines", "state", "streaming",
    "tracks", "tuning", "uncertainty", "video", "video_writer",
)  # fmt: skip
_NAMES = {
    "Eskil": "filters.factored.eskil",
    "InputError": "errors",
    "Labelled": "filters.labelled.tracker",
    "PFFL": "filters.factored.pffl",
    "ParticleState": "state",
    "Partitioned": "filters.partitioned.tracker",
    "Summary": "state",
    "forecast": "running",
    "load": "files.states",
    "monte_carlo": "running.blocks",
    "pmmh": "tuning.metropolis",
    "pytree_dataclass": "pytree",
    "run": "running",
    "save": "files.states",
    "smooth": "smoothing",
    "state_space": "filters.functions",
    "tune": "tuning",
}

if TYPE_CHECKING:
    from jaxpf import (  # noqa: F401
        boxes,
        chunks,
        contours,
        contract,
        dynamics,
        errors,
        evaluation,
        factored,
        geometry,
        gradients,
        intervals,
        joints,
        labelled,
        likelihoods,
        metrics,
        objectives,
        ordering,
        overlay,
        parts,
        plotting,
        points,
        populations,
        pytree,
        relocation,
        resampling,
        scores,
        shapes,
        smoothing,
        splines,
        state,
        streaming,
        tracks,
        tuning,
        uncertainty,
        video,
        video_writer,
    )
    from jaxpf.errors import InputError
    from jaxpf.files.states import load, save
    from jaxpf.filters.factored.eskil import Eskil
    from jaxpf.filters.factored.pffl import PFFL
    from jaxpf.filters.functions import state_space
    from jaxpf.filters.labelled.tracker import Labelled
    from jaxpf.filters.partitioned.tracker import Partitioned
    from jaxpf.pytree import pytree_dataclass
    from jaxpf.running import forecast, run
    from jaxpf.running.blocks import monte_carlo
    from jaxpf.smoothing import smooth
    from jaxpf.state import ParticleState, Summary
    from jaxpf.tuning import tune
    from jaxpf.tuning.metropolis import pmmh

__all__ = [
    "PFFL",
    "Eskil",
    "InputError",
    "Labelled",
    "ParticleState",
    "Partitioned",
    "Summary",
    "forecast",
    "load",
    "monte_carlo",
    "pmmh",
    "pytree_dataclass",
    "run",
    "save",
    "smooth",
    "state_space",
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
