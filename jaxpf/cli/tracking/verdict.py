"""A verdict on each object of a run: where to trust its track, and what to try."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from jaxpf.contract.lost import LOST_BELOW

#: Below this effective sample size the filter relies on about a single particle.
_NEAR_ONE = 2.0


def object_verdicts(table: pd.DataFrame, ids: Sequence[object]) -> dict[str, dict[str, Any]]:
    """Judge each object of tracks.csv.

    Args:
        table: from ``read_tracks``.
        ids: ids of the objects.

    Returns:
        id -> ``frames``, their number; ``tracked_until``, the last frame before the object was
        first lost (None if lost from the beginning); ``frames_lost``, their number; ``lost``, pairs
        of first and last frames; ``interval_width``, the median widths in pixels of the 95%
        intervals of the centre's x and y where the object is not lost (None if unknown);
        ``mean_confidence`` (None if the likelihood defines none).
    """
    verdicts, ids_of_rows = {}, table["id"].astype(str)
    # The start frame holds the user's input and has no speed.
    is_tracked = np.isfinite(table["speed"])
    for name in map(str, ids):
        rows = table[is_tracked & (ids_of_rows == name)]
        frames, lost = rows["frame"], rows["lost"] == 1
        stretches = _stretches(frames[lost].to_numpy())
        before = frames[frames < stretches[0][0]] if stretches else frames
        about: dict[str, Any] = {
            "frames": len(rows),
            "tracked_until": int(before.iloc[-1]) if len(before) else None,
            "frames_lost": int(lost.sum()),
            "lost": stretches,
            "interval_width": _widths(rows[~lost]),
            "mean_confidence": None,
        }
        if "confidence" in rows and len(rows):
            about["mean_confidence"] = round(float(np.mean(rows["confidence"].to_numpy())), 4)
        verdicts[name] = about
    return verdicts


def _stretches(frames: np.ndarray) -> list[list[int]]:
    """First and last frames of stretches."""
    pieces = np.split(frames, np.flatnonzero(np.diff(frames) != 1) + 1)
    return [[int(piece[0]), int(piece[-1])] for piece in pieces if len(piece)]


def _widths(rows: pd.DataFrame) -> dict[str, float] | None:
    before = "centre_" if "centre_x_2.5" in rows else ""  # x and y of a box are a corner's
    if f"{before}x_2.5" not in rows:
        return None
    widths = {axis: rows[f"{before}{axis}_97.5"] - rows[f"{before}{axis}_2.5"] for axis in "xy"}
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
    if ess is not None and ess < _NEAR_ONE < num_particles:
        lines.append(
            f"The effective sample size stays near 1 (median {ess:.2g} of {num_particles} "
            "particles), so intervals are too narrow.  Try: more particles (-n), or a less "
            "sharp likelihood (a smaller --sharpness or a larger --sigma, whichever applies)."
        )
    return lines


def _frames(stretches: list[list[int]], most: int = 4) -> str:
    texts = [f"{first} to {last}" if last > first else f"{first}" for first, last in stretches]
    shown = texts[:most] + ([f"{len(texts) - most} more stretches"] if len(texts) > most else [])
    return " and ".join([", ".join(shown[:-1]), shown[-1]]) if len(shown) > 1 else shown[0]
