"""The end of ``jaxpf track``: summary, plots, verdicts and metrics, from one table."""

import contextlib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from jaxpf.boxes.tracks import read_tracks
from jaxpf.cli.shared.console import print_table, say
from jaxpf.cli.tracking.detector import why_none_started
from jaxpf.cli.tracking.results import Results
from jaxpf.cli.tracking.verdict import object_verdicts, sentences
from jaxpf.contract import calls
from jaxpf.contract.errors import InputError
from jaxpf.files.store import versions
from jaxpf.files.writing import SUMMARY, write_text
from jaxpf.measures import metrics, scores
from jaxpf.media import plotting
from jaxpf.sequences.tables import BoxTable, dense

#: Printed scores of objects that come and go: shares, and counts.
_SCORES, _COUNTS = ("HOTA", "DetA", "AssA", "IDF1", "MOTA", "MOTP"), ("FP", "FN", "IDSW", "Frag")
#: Headings of the printed table that differ from the columns of metrics.csv.
_HEADINGS = {
    "success_rate_50": "success at IoU 0.5",
    "success_auc": "success AUC",
    "iou": "IoU",
}


def report(results: Results, truth: BoxTable | None) -> None:
    """Write summary and plots, print the verdicts, and raise the error that ended the run early."""
    if results.is_kept:
        # The tracks so far are kept; an error here must not hide the first one.
        with contextlib.suppress(*([] if results.stopped is None else [InputError])):
            _report(results, truth)
    if results.stopped is not None:
        raise results.stopped


def _report(results: Results, truth: BoxTable | None) -> None:
    request, output = results.request, results.output
    table = pd.DataFrame(read_tracks(output / "tracks.csv"))
    has_detections = request.detector is not None
    names = [new["id"] for new in results.changes["started"]] if has_detections else results.names
    verdicts = object_verdicts(table, names)
    sizes = np.array(results.ess)
    num_particles = getattr(results.tracker, "num_particles", 0)
    num_particles = int(num_particles or np.nanmax(sizes, initial=1))
    sizes = sizes[sizes > 0]  # 0 while there is no object, or where no particle explains the frame
    ess = float(np.median(sizes)) if len(sizes) else None
    content = _summary(results, names, verdicts, table, ess)
    write_text(output / SUMMARY, json.dumps(content, indent=2) + "\n")
    lost = {name: about["lost"] for name, about in verdicts.items()}
    target = request.target
    columns = [name for name in target.columns if name not in target.fixed_columns]
    figure = plotting.trajectories(table, columns, lost)
    plotting.save_figure(figure, output / "trajectories.png")
    for line in _lines(results, content, sentences(verdicts, ess, num_particles, target.place)):
        say(line)
    for warning in _warnings(results):
        say(warning, err=True)
    if truth is None:
        return
    if has_detections:
        _report_identities(results, table, truth)
    else:
        _report_truth(results, table, truth)


def _summary(
    results: Results,
    names: Sequence[object],
    verdicts: dict[str, dict[str, Any]],
    table: pd.DataFrame,
    ess: float | None,
) -> dict[str, Any]:
    request, source, stopped = results.request, results.source, results.stopped
    first, rest = results.seconds
    start = request.run.start
    frames = slice(start, max(start, results.last) + 1)
    started = results.start.ids.tolist()
    model_errors = calls.model_error(results.filter, len(started))
    method = request.options.get("likelihood")
    return {
        "parameters": {
            name: str(value) if isinstance(value, Path) else value
            for name, value in request.table(source.path).items()
        },
        # Of the likelihood, if it reports one; else the requested method.
        "likelihood_method": None
        if request.run.tracker
        else getattr(results.filter.likelihood, "method", method),
        # The error that the model declares, such as its slip: of x, y and log size.
        "model_error": dict(zip(map(str, started), model_errors.round(4).tolist(), strict=True)),
        "ids": names,
        **(results.changes if request.detector else {}),
        "objects": verdicts,
        "effective_sample_size": None if ess is None else round(ess, 3),
        "frames_tracked": results.tracked,
        "width": source.width,
        "height": source.height,
        "fps": source.fps,
        "interrupted": isinstance(stopped, KeyboardInterrupt),
        "error": str(stopped) if isinstance(stopped, InputError) else None,
        "video_truncated": source.truncated,
        "video_note": source.note,
        "remarks": list(results.start.remarks),
        "frames_outside": results.outside,
        "frames_without_likelihood": results.without_likelihood,
        "mean_mc_error": _mean_mc_errors(table, names),
        "impossible_frames": results.impossible,
        "invalid_likelihoods": results.invalid,
        "seconds_first_frame": round(first, 3),
        "seconds_other_frames": round(rest, 3),
        "frames_per_second": round((results.tracked - 1) / rest, 2) if rest > 0 else None,
        "versions": versions(),
        # Of the start frame and all that follow.
        "times": [round(source.shown_at(n), 4) for n in range(frames.start, frames.stop)],
        "pictures": source.pictures and source.pictures[frames],
    }


def _mean_mc_errors(table: pd.DataFrame, names: Sequence[object]) -> dict[str, Any] | None:
    """Mean Monte Carlo standard error of x and y in pixels by object; None unless requested."""
    if "x_mc_error" not in table:
        return None
    ids = table["id"].astype(str)
    errors = table[["x_mc_error", "y_mc_error"]]
    return {str(name): round(float(np.nanmean(errors[ids == str(name)])), 4) for name in names}


def _report_truth(results: Results, table: pd.DataFrame, truth: BoxTable) -> None:
    """Report metrics over the frames with ground truth, as a table and as metrics.csv.

    A later frame in which the user gave an object's box does not count for that object, nor does
    any frame before the object starts.
    """
    first, last = results.request.run.start + results.resumed, int(table["frame"].max())
    shared = [int(name) for name in results.names if name in set(truth.id.tolist())]
    estimate, target = (
        dense(boxes, shared, last + 1)[first + 1 :] for boxes in (_boxes(table), truth)
    )
    for place, name in enumerate(shared):
        given = [at for at, start in results.later.items() if name in start.ids and at <= last]
        target[[at - first - 1 for at in given], place] = np.nan
        if given and name not in results.start.ids:
            target[: min(given) - first - 1, place] = np.nan
    measures = metrics.summarise(estimate[None], target)
    columns = {
        "id": shared,
        "frames": np.asarray(metrics.has_truth(target)).sum(axis=0),
        "success_rate_50": np.asarray(scores.success_rate_50(estimate, target)),
        "success_auc": np.asarray(scores.success_auc(estimate, target)),
    }
    for measure in ("iou", "tracked", "precision", "recall", "centre_error"):
        columns[measure] = np.asarray(measures[measure].value)
    found = pd.DataFrame(columns)
    rows = [
        [f"object {name}", f"{count}", *(f"{value:.3f}" for value in rest)]
        for name, count, *rest in found.itertuples(index=False)
    ]
    headings = ["", *(_HEADINGS.get(name, name) for name in found.columns[1:])]
    print_table("Against the truth", headings, rows)
    _write_metrics(results, found)


def _report_identities(results: Results, table: pd.DataFrame, truth: BoxTable) -> None:
    """Report identity scores of objects that come and go, as a table and as metrics.csv."""
    first, count = results.request.run.start + results.resumed + 1, results.tracked
    estimates, targets = (
        dense(boxes, sorted(set(boxes.id.tolist())), first + count)[first:]
        for boxes in (_boxes(table), truth)
    )
    values = scores.tracking_scores(estimates, targets)
    row = [f"{values[name]:.3f}" for name in _SCORES] + [f"{values[n]:.0f}" for n in _COUNTS]
    title = f"Against the truth, {counted(count)}"
    print_table(title, ["", *_SCORES, *_COUNTS], [["all", *row]])
    _write_metrics(results, pd.DataFrame([values]))


def _write_metrics(results: Results, found: pd.DataFrame) -> None:
    text = found.to_csv(index=False, float_format="%.6g", na_rep="nan")
    write_text(results.output / "metrics.csv", text)


def _boxes(table: pd.DataFrame) -> BoxTable:
    """The boxes of tracks; one without area, as it was written, is none."""
    kept = table[(table["w"] > 0) & (table["h"] > 0)]
    unknown = np.full(len(kept), -1)
    frame, name = kept["frame"].to_numpy(), kept["id"].to_numpy()
    return BoxTable(frame, name, kept[list("xywh")].to_numpy(), unknown, unknown)


def _lines(results: Results, content: dict[str, Any], verdicts: list[str]) -> list[str]:
    """What is printed of a run."""
    rate = content["frames_per_second"]
    speed = "" if rate is None else f", {rate:.1f} frames/s"
    lines = [f"{results.output}: {counted(results.tracked)} tracked{speed}", *verdicts]
    if (errors := content["mean_mc_error"]) is not None:
        each = ", ".join(f"{name} {error:.2g}" for name, error in errors.items())
        lines.append(f"Mean Monte Carlo standard error of x and y in pixels: {each}")
    if results.request.detector is not None:
        came, gone = (len(results.changes[kind]) for kind in ("started", "ended"))
        lines.append(f"{counted(came, 'object')} came, {gone} went")
    return lines


def _warnings(results: Results) -> list[str]:
    """What is printed of a run on standard error."""
    detector, changes = results.request.detector, results.changes
    lines = [f"Note: {results.source.note}"] if results.source.note else []
    for where, frames_of in (
        ("was outside the picture", results.outside),
        ("had likelihood zero for all its particles", results.without_likelihood),
    ):
        lines += [
            f"Lost: object {name} {where} in {counted(len(frames))}, first in frame {frames[0]}."
            for name, frames in frames_of.items()
            if frames
        ]
    if results.impossible:
        lines.append(
            f"Warning: {counted(results.impossible)} had likelihood zero for all particles and "
            "counted as missing."
        )
    if results.invalid:
        number = results.invalid
        lines.append(f"Warning: {number} likelihood(s) were not a number and counted as zero.")
    if detector is not None and not changes["started"] and not changes["refused"]:
        lines.append(f"Note: {why_none_started(detector, results.request.run.start)}")
    if changes["refused"]:
        refusal = changes["refused"][0]
        lines.append(
            f"Refused: {len(changes['refused'])} that could not start, first in frame "
            f"{refusal['frame']}: {refusal['reason']}"
        )
    return lines


def counted(count: int, noun: str = "frame") -> str:
    """``1 frame``, ``2 frames``."""
    return f"{count} {noun}{'' if count == 1 else 's'}"
