"""All measurements for the paper."""

from collections.abc import Mapping
from typing import Any, NamedTuple

from jaxpf.papers.checkpoints import part
from jaxpf.papers.eskil2014 import methods, published, speed
from jaxpf.papers.eskil2014.scenes import Outcome, measure as measure_scenes
from jaxpf.papers.paper import Request

_QUICK_FRAMES = 60
#: Sequences that are drawn for the first half of the seeds only, since they have many frames.
_LONG = ("skydiving",)
#: Timings of table 3.
_REPEATS, _QUICK_REPEATS = 5, 3


class Measurement(NamedTuple):
    """All measurements.

    Attributes:
        outcomes: one for each kind of scene.
        rates: sequence -> method -> frames per second, one value per timing.
    """

    outcomes: Mapping[str, Outcome]
    rates: speed.Rates


def measure(request: Request) -> Measurement:
    """Run all measurements."""
    quick, seeds, report = request.quick, request.seeds, request.report
    names = ["platty"] if quick else list(published.SEQUENCES)
    filters = methods.QUICK if quick else methods.FILTERS
    shorter: dict[str, Any] = {"num_frames": _QUICK_FRAMES} if quick else {}
    outcomes = {}
    for name in names:
        scene, scale = published.SEQUENCES[name].scene, published.SEQUENCES[name].scale_here
        chosen = seeds[: -(-len(seeds) // 2)] if name in _LONG else seeds
        report(f"{name}: {len(chosen)} scenes, one run of every method on each")
        outcomes[scene] = measure_scenes(scene, scale, chosen, filters, report=report, **shorter)
    report("Table 3: frames per second")
    repeats = _QUICK_REPEATS if quick else _REPEATS
    rates = part("speed", lambda: speed.measure(names, repeats))
    return Measurement(outcomes, rates)
