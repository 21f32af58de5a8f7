"""How the noise of the wires' motion was chosen: the paper does not tell it.

Each likelihood has a noise of its own, that with which it keeps both wires most often, on sequences
of seeds (``SEEDS``) that no reported figure uses.
"""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from jaxpf.experiments import calibration
from jaxpf.experiments.comparison_table import Table
from jaxpf.experiments.maccormick1999.measure import WIRE_PARTICLES
from jaxpf.experiments.maccormick1999.scenes import NOISE_OF_WIRES, wires
from jaxpf.experiments.maccormick1999.tracking import track, tracker_of

#: Sequences of the search.  The command takes seeds below 2^20, so that no report uses these.
SEEDS = tuple(range(2**20, 2**20 + 8))
RUNS = 2
FACTORS = (1.0, 2.0, 3.0, 4.0, 6.0)


def calibrate(report: Callable[[str], None] = print) -> Table:
    """Repeat the search that set ``scenes.NOISE_OF_WIRES``, and show it."""
    stages = {kind: [{kind: factor} for factor in FACTORS] for kind in NOISE_OF_WIRES}
    best, trials = calibration.search(dict.fromkeys(stages, FACTORS[0]), stages, _tried, report)
    return calibration.trial_table(trials, best)


def _tried(exclusion: str, noise: Mapping[str, Any]) -> tuple[dict[str, str], float]:
    found = []
    for seed in SEEDS:
        case = wires(seed)._replace(noise=noise)
        found.append(track(case, tracker_of(case, exclusion, WIRE_PARTICLES), RUNS, seed))
    kept, coalesced = (
        100 * float(np.mean([getattr(outcome, name) for outcome in found]))
        for name in ("kept", "coalesced")
    )
    return {"kept (%)": f"{kept:.0f}", "coalesced (%)": f"{coalesced:.0f}"}, -kept
