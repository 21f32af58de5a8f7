"""All measurements for the paper."""

from jaxpf.papers.gonzales2011 import published, scenes
from jaxpf.papers.gonzales2011.scenes import Cell, Outcomes
from jaxpf.papers.judging.claims import counted
from jaxpf.papers.paper import Request

_QUICK_FRAMES, _QUICK_PARTS, _QUICK_PARTICLES = 40, 5, (5, 10)


def measure(request: Request) -> Outcomes:
    """Run all measurements."""
    quick, report = request.quick, request.report
    sequences = counted(len(request.seeds), "sequences")
    report(f"Figures 8 to 11: {sequences}, one run of 8 trackers on each")
    frames = _QUICK_FRAMES if quick else published.FRAMES
    return scenes.measure(_cells(quick), request.seeds, frames, progress=report)


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
