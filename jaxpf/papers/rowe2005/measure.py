"""Everything that is measured for the paper."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from jaxpf.papers.measuring.checkpoints import part
from jaxpf.papers.paper import Request
from jaxpf.papers.rowe2005 import bias, births, distracter, pictures
from jaxpf.papers.rowe2005.scenes import (
    RUNS_PER_SCENE,
    VARIANTS,
    Outcome,
    measure as measure_scenes,
)

#: Scenes of the comparison with PS, DPS and SPS, and runs behind the table of biases.
_COMPARED, _QUICK_COMPARED = 20, 4
_QUICK_BIAS_RUNS = 2000
_QUICK_PICTURED = 40


class Found(NamedTuple):
    """What was measured.

    Attributes:
        outcome: of all variants.
        crossing: of the mean and the product, on targets that cross.
        bias: variant -> evidence of linear-Gaussian targets.
        compared: method -> what smith2004's scene gave.
        births: tracker -> scores of people who come and go; None without the clip.
        pictures: one run in pictures, by the figure's name.
    """

    outcome: Outcome
    crossing: Outcome
    bias: Mapping[str, Mapping[str, np.ndarray]]
    compared: Mapping[str, distracter.Measured]
    births: Mapping[str, np.ndarray] | None
    pictures: Mapping[str, pictures.Pictures]


def measure(request: Request) -> Found:
    """Measure all of it."""
    seeds, seed, quick, report = request.seeds, request.seed, request.quick, request.report
    report(f"{len(seeds)} scenes with {RUNS_PER_SCENE} runs of every variant each")
    outcome = measure_scenes(
        seeds, progress=lambda done: report(f"  scene {done} of {len(seeds)} done")
    )
    report("Targets that cross: mean against product")
    likelihoods = {name: VARIANTS[name] for name in ("both", "product")}
    crossing = measure_scenes(seeds, likelihoods, name="crossing", paths="crossing")
    biased = part("bias", lambda: bias.measure(_QUICK_BIAS_RUNS if quick else bias.RUNS, seed))
    number = _QUICK_COMPARED if quick else _COMPARED
    report(f"Distracter: {number} scenes with {distracter.RUNS_PER_SCENE} runs of every method")
    compared = distracter.measure(range(seed, seed + number))
    scores = None
    if request.clips is None:
        report(f"No --data: people who come and go, {births.CLIP}, are left out")
    else:
        drawn = range(seed, seed + (births.QUICK_SEEDS if quick else births.SEEDS))
        report(f"People who come and go: {len(drawn)} seeds on {births.CLIP}")
        scores = births.measure(request.clips, drawn, report)
    report("One run in pictures")
    pictured = pictures.measure(request.data, seed, _QUICK_PICTURED if quick else None)
    return Found(outcome, crossing, biased, compared, scores, pictured)
