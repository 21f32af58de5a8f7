"""All measurements for the paper."""

from typing import Any

from jaxpf.papers.eskil2014 import methods, published
from jaxpf.papers.eskil2014.scenes import Outcome, measure as measure_scenes
from jaxpf.papers.judging.claims import counted
from jaxpf.papers.paper import Request

_QUICK_FRAMES = 60
#: Sequences that are drawn for the first half of the seeds only, since they have many frames.
_LONG = ("skydiving",)


def measure(request: Request) -> dict[str, Outcome]:
    """Run all measurements: one outcome for each kind of scene."""
    quick, seeds, report = request.quick, request.seeds, request.report
    names = ["platty"] if quick else list(published.SEQUENCES)
    filters = methods.QUICK if quick else methods.FILTERS
    shorter: dict[str, Any] = {"num_frames": _QUICK_FRAMES} if quick else {}
    outcomes = {}
    for name in names:
        scene, scale = published.SEQUENCES[name].scene, published.SEQUENCES[name].scale_here
        chosen = seeds[: -(-len(seeds) // 2)] if name in _LONG else seeds
        report(f"{name}: {counted(len(chosen), 'scenes')}, one run of every method on each")
        outcomes[scene] = measure_scenes(scene, scale, chosen, filters, report=report, **shorter)
    return outcomes
