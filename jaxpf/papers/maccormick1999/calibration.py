"""How the noise of the wires', leaves' and worms' motion was chosen: the paper does not tell it.

Each likelihood has a noise of its own, that with which it keeps both targets most often, and of
those that keep as many the one with which labels are right in most frames, on sequences of seeds
(``SEEDS``) that no reported figure uses.  Those of worms are contacts composed from one filmed pair
(``contacts``), which are harder than the pair itself; what is reported of worms is of filmed pairs.
"""

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from jaxpf.papers.judging.comparison_table import Table
from jaxpf.papers.maccormick1999 import contacts, scenes
from jaxpf.papers.maccormick1999.measure import WIRE_PARTICLES, WORM_PARTICLES
from jaxpf.papers.maccormick1999.passing import Method, Passing
from jaxpf.papers.maccormick1999.published import LEAF_PARTICLES
from jaxpf.papers.maccormick1999.tracking import track, tracker_of
from jaxpf.papers.measuring import calibration

#: Sequences of the search.  The command takes seeds below 2^20, so that no report uses these.
SEEDS = tuple(range(2**20, 2**20 + 8))
#: Runs on each sequence, by the likelihood's exclusion; what opaque targets show is dear.
RUNS = {"wires": 2, "none": 2, "opaque": 1}
#: Stages of worms: the likelihood's exclusion after it.
_OF_WORMS = "worms, "
FACTORS = (1.0, 2.0, 3.0, 4.0, 6.0)


def calibrate(report: Callable[[str], None] = print, data: Path | None = None) -> Table:
    """Repeat the search that set the scenes' ``NOISE_OF_WIRES`` and ``NOISE_OF_LEAVES``.

    With clips also a search for that of worms on composed contacts: ``NOISE_OF_WORMS`` was chosen
    on the filmed pair, which nearly every run keeps whatever its noise.

    Args:
        report: takes a line for each trial.
        data: a folder with filmed worms; None: they are left out.
    """
    kinds = [*RUNS, *(_OF_WORMS + kind for kind in scenes.NOISE_OF_WORMS if data is not None)]
    stages = {kind: [{kind: factor} for factor in FACTORS] for kind in kinds}

    def tried(kind: str, factors: Mapping[str, Any]) -> tuple[dict[str, str], tuple[float, float]]:
        return _tried(kind, factors[kind], data)

    best, trials = calibration.search(dict.fromkeys(stages, FACTORS[0]), stages, tried, report)
    return calibration.trial_table(trials, best)


def _tried(
    kind: str, factor: float, data: Path | None
) -> tuple[dict[str, str], tuple[float, float]]:
    exclusion = kind.removeprefix(_OF_WORMS)
    made: Iterable[scenes.Case] = map(scenes.wires, SEEDS)
    particles = WIRE_PARTICLES
    if exclusion == "opaque":
        made, particles = map(scenes.leaves, SEEDS), LEAF_PARTICLES
    if data is not None and exclusion != kind:
        made = (contacts.contact(data, scenes.CLIP, seed) for seed in SEEDS)
        particles = WORM_PARTICLES
    cases = [case._replace(noise={exclusion: factor}) for case in made]
    outcomes = [
        track(case, tracker_of(case, exclusion, particles), RUNS[exclusion], seed)
        for case, seed in zip(cases, SEEDS, strict=True)
    ]
    found = Passing(cases, {"": outcomes}, {"": Method(exclusion, "ps", particles)})
    figures = {
        "kept (%)": 100 * float(found.kept("").mean()),
        "coalesced (%)": 100 * float(found.coalesced("").mean()),
    }
    right = 100 * float(found.labels_right("").mean()) if exclusion == "opaque" else 0.0
    shown = {name: f"{value:.0f}" for name, value in figures.items()}
    shown["label right (%)"] = f"{right:.0f}" if exclusion == "opaque" else "-"
    return shown, (-figures["kept (%)"], -right)
