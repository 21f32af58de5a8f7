"""All measurements for the paper."""

from typing import NamedTuple

from jaxpf.papers.gonzales2011 import published, scenes, times
from jaxpf.papers.gonzales2011.scenes import Cell, Outcomes
from jaxpf.papers.paper import Request

#: Interleaved repeats of table 1.
_REPEATS, _QUICK_REPEATS = 30, 3
_QUICK_FRAMES, _QUICK_PARTS, _QUICK_PARTICLES = 40, 5, (5, 10)


class Measurement(NamedTuple):
    """All measurements.

    Attributes:
        outcomes: results of every cell of figures 8 to 11.
        times: times of table 1.
    """

    outcomes: Outcomes
    times: times.Times


def measure(request: Request) -> Measurement:
    """Run all measurements."""
    quick, report = request.quick, request.report
    report(f"Figures 8 to 11: {len(request.seeds)} sequences, one run of 8 trackers on each")
    frames = _QUICK_FRAMES if quick else published.FRAMES
    outcomes = scenes.measure(_cells(quick), request.seeds, frames, progress=report)
    report("Table 1: the time of every number of parts and particles")
    repeats = _QUICK_REPEATS if quick else _REPEATS
    timed = times.measure_times(
        (_QUICK_PARTS,) if quick else published.PARTS,
        (10, 20) if quick else published.TABLE_1_PARTICLES,
        repeats=repeats,
        report=report,
    )
    return Measurement(outcomes, timed)


def _cells(quick: bool) -> list[Cell]:
    """Cells of all figures."""
    erratic = Cell("erratic", published.FIGURE_11_PARTS, (published.FIGURE_11_PARTICLES,))
    if quick:
        return [Cell("smooth", _QUICK_PARTS, _QUICK_PARTICLES), erratic]
    return [
        *(Cell("smooth", p, published.FIGURE_8_PARTICLES) for p in published.FIGURE_8_PARTS),
        *(Cell("strong_start", p, (published.FIGURE_10_PARTICLES,)) for p in published.PARTS),
        erratic,
    ]
