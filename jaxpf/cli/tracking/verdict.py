"""A verdict on each object of a run: where to trust its track, and what to try."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from jaxpf.contract.lost import LOST_BELOW

#: Below this effective sample size the filter relies on about a single particle.
_NEAR_ONE = 2.0


def object_verdicts(
    table: Mapping[str, np.ndarray], ids: Sequence[object]
) -> dict[str, dict[str, Any]]:
    """Judge each object of tracks.csv.

    Args:
        table: columns, see ``read_tracks``.
        ids: ids of the objects.

    Returns:
        id -> ``frames``, their number; ``tracked_until``, the last frame before the object was
        first lost (None if lost from the beginning); ``frames_lost``, their number; ``lost``, pairs
        of first and last frames; ``interval_width``, the median widths in pixels of the 95%
        intervals of the centre's x and y where the object is not lost (None if unknown);
        ``mean_confidence`` (None if the likelihood defines none).
    """
    names = np.array([str(name) for name in table["id"].tolist()])
    confidence, lost = table.get("confidence"), table["lost"] == 1
    verdicts = {}
    for name in map(str, ids):
        # The start frame holds the user's input and has no speed.
        rows = np.flatnonzero((names == name) & np.isfinite(table["speed"]))
        frames = table["frame"][rows].astype(int)
        stretches = _stretches(frames[lost[rows]])
        kept = [int(row) for row in rows if not lost[row]]
        first = stretches[0][0] if stretches else None
        before = frames if first is None else frames[frames < first]
        about: dict[str, Any] = {
            "frames": len(frames),
            "tracked_until": int(before[-1]) if len(before) else None,
            "frames_lost": int(lost[rows].sum()),
            "lost": stretches,
            "interval_width": _widths(table, kept),
            "mean_confidence": None,
        }
        if confidence is not None and len(rows):
            about["mean_confidence"] = round(float(np.mean(confidence[rows])), 4)
        verdicts[name] = about
    return verdicts


def _stretches(frames: np.ndarray) -> list[list[int]]:
    """First and last frames of stretches."""
    pieces: list[list[int]] = []
    for frame in frames.tolist():
        if pieces and frame == pieces[-1][1] + 1:
            pieces[-1][1] = frame
        else:
            pieces.append([frame, frame])
    return pieces


def _widths(table: Mapping[str, np.ndarray], rows: list[int]) -> dict[str, float] | None:
    before = "centre_" if "centre_x_2.5" in table else ""  # x and y of a box are a corner's
    if f"{before}x_2.5" not in table:
        return None
    widths = {
        axis: table[f"{before}{axis}_97.5"][rows] - table[f"{before}{axis}_2.5"][rows]
        for axis in "xy"
    }
    if not all(np.isfinite(width).any() for width in widths.values()):
        return None
    return {axis: round(float(np.nanmedian(width)), 3) for axis, width in widths.items()}


def sentences(
    verdicts: Mapping[str, Mapping[str, Any]],
    ess: float | None,
    num_particles: int,
    place: str = "centre",
) -> list[str]:
    """The verdicts as sentences, with advice.

    Args:
        verdicts: see ``object_verdicts``.
        ess: median effective sample size; None if unknown.
        num_particles: N.
        place: what the intervals are of.
    """
    lines, some_lost = [], False
    for name, about in verdicts.items():
        if not about["frames"]:
            continue
        sure = about["mean_confidence"] is not None
        tracked = f"tracked with a confidence of {LOST_BELOW:g} or more" if sure else "tracked"
        until, pieces = about["tracked_until"], about["lost"]
        some_lost |= bool(pieces)
        if not pieces:
            text = f"{tracked} to the end (frame {until})"
        else:
            before = "" if until is None else f"{tracked} until frame {until}, "
            count = f"{about['frames_lost']} of {about['frames']} frames"
            text = f"{before}lost in {count} ({_frames(pieces)})"
        if about["interval_width"] is not None:
            # Two digits, never 1.6e+02.
            x, y = (float(f"{about['interval_width'][axis]:.2g}") for axis in "xy")
            text += f"; 95% interval of the {place}: {x:g} pixels wide along x, {y:g} along y"
        lines.append(f"Object {name}: {text}")
    if some_lost:
        lines.append(
            "Try: look at those frames, and at those after them, with `jaxpf view` and this folder "
            "(the object may be another one that looks alike), and draw a box or point again "
            "there, or start again from a later frame (--start); or track with more particles (-n)."
        )
    if any(about["frames"] and about["mean_confidence"] is None for about in verdicts.values()):
        lines.append(
            "This likelihood offers no confidence: a misplaced object is not reported as lost.  "
            "Try: look at the overlay."
        )
    if is_degenerate(ess, num_particles):
        lines.append(
            f"The effective sample size stays near 1 (median {ess:.2g} of {num_particles} "
            "particles), so intervals are too narrow.  Try: more particles (-n), or a less "
            "sharp likelihood (a smaller --sharpness or a larger --sigma, whichever applies)."
        )
    return lines


def is_degenerate(ess: float | None, num_particles: int) -> bool:
    """Whether the effective sample size is too small for meaningful intervals."""
    return ess is not None and num_particles > _NEAR_ONE and ess < _NEAR_ONE


def _frames(stretches: list[list[int]], most: int = 4) -> str:
    texts = [f"{first} to {last}" if last > first else f"{first}" for first, last in stretches]
    shown = texts[:most] + ([f"{len(texts) - most} more stretches"] if len(texts) > most else [])
    return " and ".join([", ".join(shown[:-1]), shown[-1]]) if len(shown) > 1 else shown[0]
