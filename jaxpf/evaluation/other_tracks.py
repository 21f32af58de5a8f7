"""Reads other trackers' results from a file and assigns each track to an object."""

import os
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from jaxpf.boxes.tracks import BoxTable, dense, read_boxes
from jaxpf.contract.errors import InputError, check_type
from jaxpf.contract.numbers import check_array, check_whole, numbers_in
from jaxpf.measures.association import pairwise_iou

# Overlap with the truth at which the MOTChallenge counts a box as a match.
_MATCH = 0.5


def read_tracks(
    path: str | os.PathLike[str], truth: ArrayLike, ids: Sequence[int], start_frame: int = 0
) -> np.ndarray:
    """Read another tracker's boxes and arrange them like the truth of a scene.

    Args:
        path: a MOT file, counting from 1, or a CSV with the header of a ``gt.csv``, counting from
            0; rows without width and height stand for absent objects.
        truth: true boxes ``[T, P, 4]``; row t is frame ``start_frame + t`` of the sequence.
        ids: ground-truth id of each of the P objects.
        start_frame: first frame of the scene in the sequence, counting from 0.

    Returns:
        float64 ``[T, P, 4]``, NaN where the file has no box.  ``match_tracks`` assigns the file's
        ids to objects; an object without a track is NaN throughout.

    Raises:
        InputError: the file cannot be read, has no boxes in these frames, or matches no object.
    """
    table = read_boxes(path)
    truth = numbers_in("truth", truth, "boxes x, y, w, h, [T, P, 4]")
    matched = match_tracks(table, truth, ids, start_frame)
    followed = [column for column, identity in enumerate(matched) if identity is not None]
    identities = [identity for identity in matched if identity is not None]
    boxes = np.full(truth.shape, np.nan)
    boxes[:, followed] = dense(table, identities, start_frame + len(truth))[start_frame:]
    return boxes


def match_tracks(
    table: BoxTable, truth: ArrayLike, ids: Sequence[int], start_frame: int = 0
) -> list[int | None]:
    """Match the tracks in a file to the objects.

    Two rules apply in the first frame, from ``start_frame`` on, in which the file has a box:

    1. The file uses the truth's ids if all of ``ids`` occur in it and no box of another id
       overlaps an object more than the object's own box does (or, if the frame lacks the own box,
       by .5 or more).
    2. Otherwise tracks are assigned greedily by IoU (intersection over union), one track per
       object, down to an IoU of .5, the MOTChallenge's threshold for a match.

    Args:
        table: the file's boxes.
        truth: true boxes ``[T, P, 4]``; row t is frame ``start_frame + t``.
        ids: ground-truth id of each of the P objects.
        start_frame: counting from 0.

    Returns:
        The id in the table for each object; None for an object without a matching track.

    Raises:
        InputError: the T frames hold no box, or no box matches an object.
    """
    check_type("table", table, BoxTable)
    truth = numbers_in("truth", truth, "boxes x, y, w, h, [T, P, 4]")
    check_array("ids", ids, f"one for each object, [{truth.shape[1]}]")
    check_whole("start_frame", start_frame, 0)
    last_frame = start_frame + len(truth) - 1
    frames = table.frame[(table.frame >= start_frame) & (table.frame <= last_frame)]
    if len(frames) == 0:
        has = f"lie in {table.frame.min()} to {table.frame.max()}" if len(table) else "are none"
        raise InputError(
            f"{table.source} has no box in the scene's frames {start_frame} to {last_frame}: its "
            f"frames (counting from 0) {has}; check that it belongs to the scene"
        )
    frame = int(frames.min())
    rows = np.flatnonzero(table.frame == frame)
    there = table.id[rows]
    iou = pairwise_iou(truth[frame - start_frame], table.box[rows])  # [P, rows]

    is_own = np.asarray(ids)[:, None] == there
    own, best = np.where(is_own, iou, 0).max(axis=1), iou.max(axis=1)
    is_contradicted = (best > own) & (is_own.any(axis=1) | (best >= _MATCH))
    if set(ids) <= set(table.id.tolist()) and not is_contradicted.any():
        return [int(identity) for identity in ids]

    matched: list[int | None] = [None] * len(ids)
    while iou.max() >= _MATCH:
        column, row = np.unravel_index(np.argmax(iou), iou.shape)
        matched[column] = int(there[row])
        iou[column], iou[:, row] = 0, 0
    if all(identity is None for identity in matched):
        raise InputError(
            f"no box of {table.source} in frame {frame} (counting from 0) overlaps an object of "
            f"the scene by {_MATCH:g} or more; check that it belongs to the scene, and that it "
            "counts frames and pixels from 1 if it has no header"
        )
    return matched
