"""jaxpf: particle filters for visual tracking of many, articulated and deformable objects.

The map, downwards: a file imports from its own room and from rooms below it, never from above.

``cli/``
    The command line, one file per command.
``experiments/``
    The papers' tables and figures repeated, one folder per paper; speed measured.
``evaluation/``, ``tuning/``
    Many runs compared, with intervals, resumed where interrupted; parameters found by gradient.
``targets/``
    What a substate means, one file per target: boxes, parts, points, contours.  A target says
    where it starts, which model follows, and what it reports.
``baselines/``
    Trackers of other kinds to compare with: optical flow, SPOT, IoU; simulated detections.
``files/``, ``media/``, ``measures/``
    Tables of tracks in and out; video, drawing and plots; how good tracks are.
``filters/``
    How guesses are organised: ``partitioned/`` (SIR, PS, DPS, SPS and branched, one kernel),
    ``labelled/`` (each particle holds one of many targets), ``factored/`` (PFFL and eskil2014:
    every partition has particles of its own).  A tracker is a filter on a target's model; neither
    knows the other.
``models/``
    How a substate moves (``dynamics``, ``joints``) and explains a frame (``likelihoods``).
``checks``, ``contract``, ``state``, ``running``, ``chunks``, ``streaming``
    What a tracker, a dynamics and a likelihood are; what a frame reports; over the frames.
``lowering/``
    What is written for the compiler's sake, and nothing else.
``options``, ``names``, ``pytree``, ``errors``
    What everything shares; an option is declared once, beside the filter or target that has it.

``scenes``, the package beside this one, makes synthetic sequences and reads annotated clips; it
imports nothing of ``jaxpf``.

Names are imported when they are first used (PEP 562), because importing JAX takes most of a
second that ``jaxpf --help`` and a script that only reads files need not spend.
"""

import importlib
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

#: Public modules by the name under which ``import jaxpf`` shows them.
_MODULES = {
    "articulated": "targets.articulated",
    "boxes": "targets.boxes",
    "chunks": "chunks",
    "contours": "targets.contour_tracking",
    "contract": "contract",
    "dynamics": "models.dynamics",
    "errors": "errors",
    "evaluation": "evaluation",
    "geometry": "models.geometry",
    "gradients": "filters.partitioned.gradients",
    "intervals": "measures.intervals",
    "joints": "models.joints",
    "labelled": "filters.labelled.tracker",
    "likelihoods": "models.likelihoods",
    "metrics": "measures.metrics",
    "objectives": "tuning.objectives",
    "ordering": "filters.partitioned.ordering",
    "overlay": "media.overlay",
    "partitioned": "filters.partitioned.tracker",
    "plotting": "media.plotting",
    "populations": "targets.populations",
    "pytree": "pytree",
    "resampling": "filters.resampling",
    "running": "running",
    "scores": "measures.scores",
    "shape_learning": "models.shape_learning",
    "shapes": "models.shapes",
    "splines": "models.splines",
    "state": "state",
    "streaming": "streaming",
    "track_matching": "measures.track_matching",
    "tracking": "streaming",
    "tracks": "files.tracks",
    "tuning": "tuning",
    "video": "media.video",
    "video_writer": "media.video_writer",
}
_NAMES = {
    "Eskil": "filters.factored.eskil",
    "InputError": "errors",
    "Labelled": "filters.labelled.tracker",
    "PFFL": "filters.factored.pffl",
    "ParticleState": "state",
    "Partitioned": "filters.partitioned.tracker",
    "Summary": "state",
    "monte_carlo": "running",
    "pytree_dataclass": "pytree",
    "run": "running",
    "tune": "tuning",
}

if TYPE_CHECKING:
    from jaxpf import (  # noqa: F401
        chunks,
        contract,
        errors,
        evaluation,
        pytree,
        running,
        state,
        streaming,
        tuning,
    )
    from jaxpf.errors import InputError
    from jaxpf.files import tracks  # noqa: F401
    from jaxpf.filters import resampling  # noqa: F401
    from jaxpf.filters.factored.eskil import Eskil
    from jaxpf.filters.factored.pffl import PFFL
    from jaxpf.filters.labelled.tracker import Labelled
    from jaxpf.filters.partitioned import gradients, ordering  # noqa: F401
    from jaxpf.filters.partitioned.tracker import Partitioned
    from jaxpf.measures import intervals, metrics, scores, track_matching  # noqa: F401
    from jaxpf.media import overlay, plotting, video, video_writer  # noqa: F401
    from jaxpf.models import (  # noqa: F401
        dynamics,
        geometry,
        joints,
        likelihoods,
        shape_learning,
        shapes,
        splines,
    )
    from jaxpf.pytree import pytree_dataclass
    from jaxpf.running import monte_carlo, run
    from jaxpf.state import ParticleState, Summary
    from jaxpf.targets import articulated, boxes, populations  # noqa: F401
    from jaxpf.targets import contour_tracking as contours  # noqa: F401
    from jaxpf.tuning import objectives, tune  # noqa: F401

__all__ = [
    "PFFL",
    "Eskil",
    "InputError",
    "Labelled",
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
        return importlib.import_module(f"jaxpf.{_MODULES[name]}")
    raise AttributeError(f"module 'jaxpf' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*__all__, *_MODULES])
