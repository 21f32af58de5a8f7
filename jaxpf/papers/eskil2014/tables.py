"""Errors on scenes and clips, and frames per second."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from jaxpf.measures import points as measures
from jaxpf.papers.eskil2014 import clips, methods, published, speed
from jaxpf.papers.eskil2014.clips import Marked
from jaxpf.papers.eskil2014.measure import Found
from jaxpf.papers.eskil2014.scenes import Outcome, spot_scenes
from jaxpf.papers.judging.claims import Measured, wilson
from jaxpf.papers.judging.comparison_table import Cell, Rows, Table
from jaxpf.papers.judging.estimates import mean_cell, only

#: A point is kept, or found again, within this share of the body's length.
NEAR = 0.1
#: Frames after an occlusion in which a point is to be found again.
WITHIN = 30
#: In the last so many of these it is near, in the median.
_STAYS = 10


def tables(found: Found) -> list[Table]:
    """All of them, in the order in which they are shown."""
    return [
        *map(scene_table, found.outcomes.values()),
        *(clip_table(clip, distances) for clip, distances in found.clips),
        speed_table(found.rates),
    ]


def by_scene(outcome: Outcome, method: str, measure: Any) -> np.ndarray:
    """``measure(errors [R, T, P], visible [T, P]) -> [R]``, averaged over the runs: ``[S]``."""
    return np.array(
        [
            float(np.mean(measure(errors, visible)))
            for errors, visible in zip(outcome.errors[method], outcome.visible, strict=False)
        ]
    )


def kept(errors: np.ndarray, visible: np.ndarray) -> np.ndarray:
    """Points near their places at the end, of every run."""
    return measures.points_kept(errors, NEAR)


def found_again(errors: np.ndarray, visible: np.ndarray) -> np.ndarray:
    """Share of the ``ended_occlusions`` after which a point was found again; NaN without any.

    It is if its median distance in the last ten of ``WITHIN`` frames is small: one frame in which
    it happens to pass by is not enough.
    """
    again = [
        np.median(errors[:, back + WITHIN - _STAYS : back + WITHIN, point], axis=1) <= NEAR
        for point, back in ended_occlusions(visible)
    ]
    return np.mean(again, axis=0) if again else np.full(len(errors), np.nan)


def ended_occlusions(visible: np.ndarray) -> list[tuple[int, int]]:
    """Points that come back into view and stay there for ``WITHIN`` frames, and when they do."""
    return [
        (point, back)
        for point, _, back in measures.recoveries(visible)
        if back + WITHIN <= len(visible) and visible[back : back + WITHIN, point].all()
    ]


def scene_table(outcome: Outcome) -> Table:
    """Every method's errors on one kind of scene."""
    num_points = len(outcome.names)
    rows: Rows = []
    for method in outcome.errors:
        in_view = by_scene(outcome, method, measures.mean_error)
        hidden = by_scene(outcome, method, lambda e, v: measures.mean_error(e, ~v))
        last = by_scene(outcome, method, lambda e, v: measures.mean_error(e[:, -10:]))
        ends = by_scene(outcome, method, kept)
        again = 100 * by_scene(outcome, method, found_again)
        proposed = method in (methods.PROPOSED, "eskil2014 as printed")
        known = None
        if outcome.scene == "fish" and method in (methods.PFFL, "PFFL as printed"):
            known = float(published.KEPT_PFFL)
        elif outcome.scene == "fish" and proposed:
            known = float(published.KEPT_PROPOSED)
        rows.append(
            (
                method,
                [
                    mean_cell(100 * in_view, 1),
                    mean_cell(100 * hidden, 1),
                    mean_cell(100 * last, 1),
                    mean_cell(ends, 1, known),
                    mean_cell(again),
                ],
            )
        )
    scenes, runs = outcome.errors[next(iter(outcome.errors))].shape[:2]
    return Table(
        f"errors_{outcome.scene}",
        f"{outcome.scene}: mean distance over the body's length (%), {num_points} points; "
        "published | measured",
        ["", "all frames", "while hidden", "last 10 frames", "points kept", "found again (%)"],
        rows,
        f"{scenes} scenes with {runs} runs each; the scenes are the units of the intervals.  A "
        f"point is kept if its median distance in the last 10 frames is at most {NEAR:g} of the "
        f"body's length, and found again if it comes that near within {WITHIN} frames of its "
        "return, to stay.  SPOT, Lucas-Kanade and not moving are deterministic; SPOT "
        f"was run on the first {spot_scenes(scenes)} scenes.",
    )


def clip_table(clip: Marked, found: Mapping[str, np.ndarray]) -> Table:
    """Errors, correct points and recoveries of every method on one clip."""
    visible, marked = clip.visible[1:], clip.marked[1:]
    hidden = marked[:, None] & ~visible
    back = measures.recoveries(clip.visible[clip.marked])
    rows: Rows = []
    for method, distance in found.items():
        cells: list[Cell | str] = [
            mean_cell(measures.mean_error(distance, visible), 1),
            mean_cell(measures.mean_error(distance, hidden), 1),
        ]
        for share in clips.SHARES:
            within = measures.share_within(distance, share * clip.length, visible)
            cells.append(mean_cell(100 * within, 0))
        cells.append(_recovered(clip, distance))
        rows.append((method, cells))
    listed = ", ".join(f"{clip.names[point]} (mark {at})" for point, _, at in back) or "none"
    left_out = (
        f"  Hidden at the start, or where another is, and left out: {', '.join(clip.left_out)}."
        * bool(clip.left_out)
    )
    truth = "a network's" if clip.name == clips.CLIPS[2] else "made by hand"
    return Table(
        f"clip_{clip.name}",
        f"{clip.name}: distance from the marks (pixels), points within a share of the body's "
        f"length, {clip.length:.0f} pixels (%)",
        [
            "",
            "in view",
            "hidden",
            *(f"within {share:g}" for share in clips.SHARES),
            f"found again, of {len(back)} (%)",
        ],
        rows,
        f"{len(clip.names)} points in {int(clip.marked[1:].sum())} marked frames; marks are "
        f"{truth}, those of hidden points guesses.  Intervals are over runs on this one clip."
        f"{left_out}  Occlusions that end, judged at the first mark in view, within "
        f"{clips.SHARES[1]:g} of the length: {listed}.  Not in the paper.",
    )


def _recovered(clip: Marked, distance: np.ndarray) -> Cell:
    # Where points start they are right: a frame of zeros stands for it.
    start = np.zeros((len(distance), 1, distance.shape[-1]))
    whole = np.concatenate([start, distance], axis=1)[:, clip.marked]
    again = measures.recovered(
        whole, clip.visible[clip.marked], clips.SHARES[1] * clip.length, within=clips.MARKS
    )
    if again.shape[-1] == 0:
        return Cell()
    by_run = 100 * again.mean(axis=-1)
    if len(by_run) > 1 and np.ptp(by_run) > 0:
        return mean_cell(by_run, 0)
    if len(by_run) == 1:
        return Cell(None, only(by_run[0]))
    interval = wilson(len(by_run) * by_run[0] / 100, len(by_run))(0.95)
    return Cell(None, Measured(float(by_run[0]), *interval))


def speed_table(rates: speed.Rates) -> Table:
    """Table 3: published beside ours."""
    rows: Rows = []
    for name, found in rates.items():
        sequence = published.SEQUENCES[name]
        known = {
            methods.PROPOSED: sequence.proposed,
            methods.PFFL: sequence.pffl,
            methods.SPOT: sequence.spot,
        }
        cells = [
            Cell(figure, only(found[method].max()) if method in found else None, 2)
            for method, figure in known.items()
        ]
        rows.append((f"{name} ({sequence.scene})", cells))
    repeats = len(next(iter(rates.values()))[methods.PROPOSED])
    return Table(
        "frames_per_second",
        "Table 3: frames per second, published | measured",
        ["", methods.PROPOSED, methods.PFFL, methods.SPOT],
        rows,
        f"M = {published.PARTICLES} and {published.PFFL_PARTICLES} particles per point; the "
        "published figures are of MATLAB on a core of 2.2 GHz.  Ours, this machine, by the time "
        f"of its processor: the fastest of {repeats} timings over {speed.FRAMES} frames, of SPOT "
        f"over {speed.SPOT_FRAMES}; on the scenes' own pictures, of which the fish's, 960 x 540, "
        "are half as wide and high as the film's (SPOT searches them whole).",
    )
