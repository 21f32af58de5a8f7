"""Everything that is measured for the paper."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from jaxpf.papers.eskil2014 import clips, methods, published, speed
from jaxpf.papers.eskil2014.scenes import RUNS_PER_SCENE, Outcome, measure as measure_scenes
from jaxpf.papers.measuring.checkpoints import part
from jaxpf.papers.paper import Request

_CLIP_RUNS, _QUICK_FRAMES = 50, 60
#: Timings of table 3.
_REPEATS, _QUICK_REPEATS = 5, 3


class Found(NamedTuple):
    """What was measured.

    Attributes:
        outcomes: on every kind of scene.
        clips: each clip with its methods' distances ``[R, T, P]``, pixels.
        rates: sequence -> method -> frames per second, one for each timing.
    """

    outcomes: Mapping[str, Outcome]
    clips: Sequence[tuple[clips.Marked, Mapping[str, np.ndarray]]]
    rates: speed.Rates


def measure(request: Request) -> Found:
    """Measure all of it."""
    quick, report = request.quick, request.report
    names = ["platty"] if quick else list(published.SEQUENCES)
    filters = methods.QUICK if quick else methods.FILTERS
    others = methods.OTHERS[1:] if quick else methods.OTHERS
    shorter = {"num_frames": _QUICK_FRAMES} if quick else {}
    outcomes = {}
    for name in names:
        sequence = published.SEQUENCES[name]
        report(
            f"{name}: {len(request.seeds)} scenes with {RUNS_PER_SCENE} runs of every method each"
        )
        outcomes[sequence.scene] = measure_scenes(
            sequence.scene,
            sequence.scale,
            request.seeds,
            filters,
            others,
            report=report,
            **shorter,
        )
    marked: Sequence[clips.Marked] = request.clips or ()
    if marked:
        report("Clips")
    runs = RUNS_PER_SCENE if quick else _CLIP_RUNS
    distances = [clips.measure(clip, runs, filters, others, report) for clip in marked]
    report("Table 3: frames per second")
    repeats = _QUICK_REPEATS if quick else _REPEATS
    rates = part("speed", lambda: speed.measure(names, repeats, with_spot=not quick))
    return Found(outcomes, list(zip(marked, distances, strict=True)), rates)
