"""Recovery against the distance to which the distracter leads the trackers."""

from collections.abc import Sequence
from typing import NamedTuple

from jaxpf.papers.judging.claims import Measured
from jaxpf.papers.judging.estimates import rate_of
from jaxpf.papers.smith2004.scenes import METHODS, RUNS_PER_SCENE, SCENE, Outcome, measure

#: Pixels between object 1 and the distracter in the last frame that shows it.
DISTANCES = (15.0, 22.0, 30.0, 40.0, 50.0)


class Sweep(NamedTuple):
    """Recovery of object 1 at several distances, over all sharpness values.

    Attributes:
        distances: ``[K]``.
        rates: method -> one figure per distance.
        num_scenes: for each distance.
    """

    distances: tuple[float, ...]
    rates: dict[str, list[Measured]]
    num_scenes: int


def sweep(
    seeds: Sequence[int],
    distances: Sequence[float] = DISTANCES,
    known: Outcome | None = None,
) -> Sweep:
    """Measure recovery at every distance.

    Args:
        seeds: of the scenes.
        distances: values of the scene's ``lead_distance``.
        known: an outcome at ``SCENE``'s own distance whose scenes begin with ``seeds``.
    """
    rates: dict[str, list[Measured]] = {method: [] for method in METHODS}
    for distance in distances:
        if known is not None and distance == SCENE["lead_distance"]:
            outcome = known
        else:
            parameters = {**SCENE, "lead_distance": distance}
            outcome = measure(seeds, parameters, name=f"distance_{distance:g}")
        for method in METHODS:
            # All sharpness values of a run count as one trial: they share scene and key.
            by_scene = outcome.recovered[: len(seeds), outcome.of(method)].mean(axis=(1, 2, 3))
            rates[method].append(
                rate_of(by_scene, RUNS_PER_SCENE * len(outcome.of(method))).measured()
            )
    return Sweep(tuple(distances), rates, len(seeds))
