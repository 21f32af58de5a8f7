"""Errors on scenes."""

from collections.abc import Mapping

from jaxpf.files.tables import Table
from jaxpf.papers.eskil2014 import methods, published
from jaxpf.papers.eskil2014.measures import NEAR, WITHIN, of_scene
from jaxpf.papers.eskil2014.scenes import Outcome
from jaxpf.papers.judging.claims import counted
from jaxpf.papers.judging.measures import measure_table

_KEPT = {
    **dict.fromkeys((methods.PFFL, "PFFL as printed"), published.KEPT_PFFL),
    **dict.fromkeys((methods.PROPOSED, methods.PRINTED), published.KEPT_PROPOSED),
}


def tables(outcomes: Mapping[str, Outcome]) -> list[Table]:
    """A table for each kind of scene."""
    return [scene_table(outcome) for outcome in outcomes.values()]


def scene_table(outcome: Outcome) -> Table:
    """Errors of every method on one kind of scene."""
    scenes = counted(len(outcome.visible), "scenes")
    if methods.SPOT in outcome.errors:
        scenes += f", of SPOT {len(outcome.errors[methods.SPOT])}"
    kept = _KEPT if outcome.scene == "fish" else {}
    return measure_table(
        {outcome.scene: outcome},
        f"errors_{outcome.scene}",
        f"{outcome.scene}: mean distance over the body's length (%), {len(outcome.names)} points; "
        "published | measured",
        of_scene(outcome.scene),
        list(outcome.errors),
        f"{scenes}.  A point is kept if its median distance in the last 10 frames is at most "
        f"{NEAR:g} of the body's length, and recovered if it comes that near within {WITHIN} "
        "frames of its return, and stays.",
        published={(method, "points kept"): float(count) for method, count in kept.items()},
    )
