"""``jaxpf track --truth``: print and write how close tracks are to the ground truth."""

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from jaxpf.cli.shared import console
from jaxpf.files.writing import csv_text, write_text
from jaxpf.measures import metrics, scores
from jaxpf.sequences.tables import BoxTable, dense

_SCORES = ("HOTA", "DetA", "AssA", "IDF1", "MOTA", "MOTP")
_COUNTS = ("FP", "FN", "IDSW", "Frag")
#: Headings of the printed table that differ from the columns of the file.
_HEADINGS = {
    "success_rate_50": "success at IoU 0.5",
    "success_auc": "success AUC",
    "iou": "IoU",
}


def report_truth(
    output: Path,
    table: pd.DataFrame,
    ids: Sequence[Any],
    first: int,
    truth: BoxTable,
    given: Mapping[int, Sequence[object]],
    late: Collection[object],
) -> None:
    """Report metrics over the frames with ground truth, as a table and as metrics.csv.

    Args:
        output: folder of the run.
        table: its tracks, from ``read_tracks``.
        ids: ids of the objects.
        first: start frame; metrics cover the frames after it.
        truth: boxes, as returned by ``read_boxes``.
        given: later frame -> ids of the objects whose boxes the user gave there; such a frame does
            not count for them.
        late: ids of those that start in the first such frame; none before it counts, either.
    """
    last = int(table["frame"].max())
    shared = [int(i) for i in ids if i in set(truth.id.tolist())]
    estimate = dense(_boxes(table), shared, last + 1)[first + 1 :]
    target = dense(truth, shared, last + 1)[first + 1 :]
    for number, name in enumerate(shared):
        at = [frame for frame, ids in given.items() if name in ids and frame <= last]
        if name in late and at:
            at += range(first + 1, min(at))
        target[np.array(at, int) - first - 1, number] = np.nan
    measures = metrics.summarise(estimate[None], target)
    columns = {
        "frames": np.asarray(metrics.has_truth(target)).sum(axis=0),
        "success_rate_50": np.asarray(scores.success_rate_50(estimate, target)),
        "success_auc": np.asarray(scores.success_auc(estimate, target)),
    }
    for measure in ("iou", "tracked", "precision", "recall", "centre_error"):
        columns[measure] = np.asarray(measures[measure].value)
    values = list(zip(shared, *columns.values(), strict=True))
    rows = [
        [f"object {name}", f"{count:.0f}", *(f"{value:.3f}" for value in rest)]
        for name, count, *rest in values
    ]
    console.print_table(
        "Against the truth", ["", *(_HEADINGS.get(name, name) for name in columns)], rows
    )
    lines = [[name, *(f"{value:.6g}" for value in row)] for name, *row in values]
    write_text(output / "metrics.csv", csv_text([["id", *columns], *lines]))


def report_identities(
    output: Path, start: int, num_frames: int, table: pd.DataFrame, truth: BoxTable
) -> None:
    """Report identity scores of objects that come and go, as a table and as metrics.csv.

    Args:
        output: folder of the run.
        start: start frame; scores cover the frames after it.
        num_frames: number of frames after the start frame.
        table: its tracks, from ``read_tracks``.
        truth: boxes, as returned by ``read_boxes``.
    """
    first = start + 1
    estimates, targets = (
        dense(boxes, sorted(set(boxes.id.tolist())), first + num_frames)[first:]
        for boxes in (_boxes(table), truth)
    )
    values = scores.tracking_scores(estimates, targets)
    row = [f"{values[name]:.3f}" for name in _SCORES] + [f"{values[n]:.0f}" for n in _COUNTS]
    title = f"Against the truth, {num_frames} frame{'' if num_frames == 1 else 's'}"
    console.print_table(title, ["", *_SCORES, *_COUNTS], [["all", *row]])
    lines = [values, [f"{value:.6g}" for value in values.values()]]
    write_text(output / "metrics.csv", csv_text(lines))


def _boxes(table: pd.DataFrame) -> BoxTable:
    """The boxes of tracks; one without area, as it was written, is none."""
    box = table[list("xywh")].to_numpy()
    kept = (box[:, 2:] > 0).all(axis=1)
    unknown = np.full(kept.sum(), -1)
    frame, name = (table[column].to_numpy()[kept] for column in ("frame", "id"))
    return BoxTable(frame, name, box[kept], unknown, unknown)
