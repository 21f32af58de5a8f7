"""Everything that is measured for the paper."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from jaxpf.papers.gonzales2011 import flies, published, scenes, times
from jaxpf.papers.gonzales2011.scenes import RUNS_PER_SCENE, Cell, Outcomes
from jaxpf.papers.measuring.checkpoints import part
from jaxpf.papers.paper import Request

#: Interleaved repeats of table 1.
_REPEATS, _QUICK_REPEATS = 30, 3
QUICK_FRAMES = 40
_QUICK_PARTS, _QUICK_PARTICLES = 5, (5, 10)
_QUICK_FLY_RUNS = 4


class Found(NamedTuple):
    """What was measured.

    Attributes:
        outcomes: of every cell of figures 8 to 11.
        times: of table 1.
        others: of the numbers of particles that figure 8 has and table 1 lacks.
        flies: method -> distances of the joints, or None without the clip.
        largest: method -> seconds of table 1's largest cell with all runs of a figure batched;
            None of the quick version.
    """

    outcomes: Outcomes
    times: times.Times
    others: times.Times
    flies: Mapping[str, np.ndarray] | None
    largest: Mapping[str, np.ndarray] | None


def measure(request: Request) -> Found:
    """Measure all of it."""
    quick, report = request.quick, request.report
    report(
        f"Figures 8 to 11: {len(request.seeds)} sequences with {RUNS_PER_SCENE} runs of 8 "
        "trackers each"
    )
    frames = QUICK_FRAMES if quick else published.FRAMES
    outcomes = scenes.measure(_cells(quick), request.seeds, frames, progress=report)
    distances = None
    if request.clips is not None:
        report(f"Flies: the clip {flies.CLIP}")
        runs = _QUICK_FLY_RUNS if quick else flies.RUNS
        distances = part("flies", lambda: flies.measure(request.clips, runs))
    report("Table 1: the time of every number of parts and particles")
    repeats = _QUICK_REPEATS if quick else _REPEATS
    timed = times.measure_times(
        (_QUICK_PARTS,) if quick else published.PARTS,
        (10, 20) if quick else published.TABLE_1_PARTICLES,
        repeats=repeats,
        report=report,
    )
    others: times.Times = {}
    largest = None
    if not quick:
        lacking = sorted({*published.FIGURE_8_PARTICLES} - {*published.TABLE_1_PARTICLES})
        report(f"At equal time: the time of N = {', '.join(map(str, lacking))}")
        parts = published.FIGURE_8_PARTS
        others = times.measure_times(parts, lacking, repeats=repeats, report=report)
        most, particles = times.LARGEST
        report(f"Speed: {most} parts, N = {particles}, {published.RUNS} runs batched")
        found = times.measure_times((most,), (particles,), 10, repeats, published.RUNS, report)
        largest = found[times.LARGEST]
    return Found(outcomes, timed, others, distances, largest)


def _cells(quick: bool) -> list[Cell]:
    """Of every figure."""
    erratic = Cell("erratic", published.FIGURE_11_PARTS, (published.FIGURE_11_PARTICLES,))
    if quick:
        return [Cell("smooth", _QUICK_PARTS, _QUICK_PARTICLES), erratic]
    return [
        *(Cell("smooth", p, published.FIGURE_8_PARTICLES) for p in published.FIGURE_8_PARTS),
        *(Cell("strong_start", p, (published.FIGURE_10_PARTICLES,)) for p in published.PARTS),
        erratic,
    ]
