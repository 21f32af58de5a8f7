"""Errors on scenes."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from jaxpf.files.tables import Rows, Table
from jaxpf.measures import points as measures
from jaxpf.papers.eskil2014 import methods, published
from jaxpf.papers.eskil2014.scenes import Outcome
from jaxpf.papers.judging.claims import counted
from jaxpf.papers.judging.estimates import mean_cell

#: A point counts as kept or recovered within this distance, relative to the body's length.
NEAR = 0.1
#: Number of frames after an occlusion within which a point must be recovered.
WITHIN = 30
#: Number of final frames of ``WITHIN`` in which the median distance must be small.
_STAYS = 10


def tables(outcomes: Mapping[str, Outcome]) -> list[Table]:
    """A table for each kind of scene."""
    return [scene_table(outcome) for outcome in outcomes.values()]


def by_scene(outcome: Outcome, method: str, measure: Any) -> np.ndarray:
    """``measure(errors [R, T, P], visible [T, P]) -> [R]``, averaged over runs: ``[S]``."""
    return np.array(
        [
            float(np.mean(measure(errors, visible)))
            for errors, visible in zip(outcome.errors[method], outcome.visible, strict=False)
        ]
    )


def kept(errors: np.ndarray, visible: np.ndarray) -> np.ndarray:
    """Number of points near their true positions at the end, per run."""
    return measures.points_kept(errors, NEAR)


def found_again(errors: np.ndarray, visible: np.ndarray) -> np.ndarray:
    """Share of the ``ended_occlusions`` after which a point was recovered; NaN without any.

    A point is recovered if its median distance in the last ten of ``WITHIN`` frames is small; being
    near in a single frame is not enough.
    """
    again = [
        np.median(errors[:, back + WITHIN - _STAYS : back + WITHIN, point], axis=1) <= NEAR
        for point, back in ended_occlusions(visible)
    ]
    return np.mean(again, axis=0) if again else np.full(len(errors), np.nan)


def ended_occlusions(visible: np.ndarray) -> list[tuple[int, int]]:
    """Points that reappear and stay visible for ``WITHIN`` frames, with the frame."""
    return [
        (point, back)
        for point, _, back in measures.recoveries(visible)
        if back + WITHIN <= len(visible) and visible[back : back + WITHIN, point].all()
    ]


def scene_table(outcome: Outcome) -> Table:
    """Errors of every method on one kind of scene."""
    num_points = len(outcome.names)
    rows: Rows = []
    for method in outcome.errors:
        in_view = by_scene(outcome, method, measures.mean_error)
        hidden = by_scene(outcome, method, lambda e, v: measures.mean_error(e, ~v))
        last = by_scene(outcome, method, lambda e, v: measures.mean_error(e[:, -10:]))
        ends = by_scene(outcome, method, kept)
        again = 100 * by_scene(outcome, method, found_again)
        proposed = method in (methods.PROPOSED, methods.PRINTED)
        in_paper = None
        if outcome.scene == "fish" and method in (methods.PFFL, "PFFL as printed"):
            in_paper = float(published.KEPT_PFFL)
        elif outcome.scene == "fish" and proposed:
            in_paper = float(published.KEPT_PROPOSED)
        rows.append(
            (
                method,
                [
                    mean_cell(100 * in_view, 1),
                    mean_cell(100 * hidden, 1),
                    mean_cell(100 * last, 1),
                    mean_cell(ends, 1, in_paper),
                    mean_cell(again),
                ],
            )
        )
    scenes = counted(len(outcome.visible), "scenes")
    if methods.SPOT in outcome.errors:
        scenes += f", of SPOT {len(outcome.errors[methods.SPOT])}"
    return Table(
        f"errors_{outcome.scene}",
        f"{outcome.scene}: mean distance over the body's length (%), {num_points} points; "
        "published | measured",
        ["", "all frames", "while hidden", "last 10 frames", "points kept", "recovered (%)"],
        rows,
        f"{scenes}.  A point is kept if its median distance in the last 10 frames is at "
        f"most {NEAR:g} of the body's length, and recovered if it comes that near within "
        f"{WITHIN} frames of its return, and stays.",
    )
