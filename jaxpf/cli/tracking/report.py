"""The end of ``jaxpf track``: verdicts, summary, plots and metrics, from the table of tracks."""

import contextlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from jaxpf.boxes.tracks import read_tracks
from jaxpf.cli.shared.console import print_table, say
from jaxpf.cli.tracking.results import Results
from jaxpf.contract import calls
from jaxpf.contract.errors import InputError
from jaxpf.contract.lost import LOST_BELOW
from jaxpf.files.store import versions
from jaxpf.files.writing import SUMMARY, write_text
from jaxpf.measures import metrics, scores
from jaxpf.media import plotting
from jaxpf.sequences.tables import BoxTable, dense
from jaxpf.shapes.rectangles import is_proper

#: Below this effective sample size the filter relies on about a single particle.
_NEAR_ONE = 2.0
#: Printed scores of objects that come and go: shares, and counts.
_SCORES, _COUNTS = ("HOTA", "DetA", "AssA", "IDF1", "MOTA", "MOTP"), ("FP", "FN", "IDSW", "Frag")
#: Headings of the printed table that differ from the columns of metrics.csv.
_HEADINGS = {
    "success_rate_50": "success at IoU 0.5",
    "success_auc": "success AUC",
    "iou": "IoU",
}


def report(results: Results) -> None:
    """Write summary and plots, print the verdicts, and raise the error that ended the run early."""
    if results.is_kept:
        # The tracks so far are kept; an error here must not hide the first one.
        with contextlib.suppress(*([] if results.stopped is None else [InputError])):
            _report(results)
    if results.stopped is not None:
        raise results.stopped


def _report(results: Results) -> None:
    request, output, truth = results.request, results.output, results.request.truth
    table = pd.DataFrame(read_tracks(output / "tracks.csv"))
    diagnostics = pd.read_csv(output / "diagnostics.csv")
    verdicts = object_verdicts(table, results.names)
    sizes = diagnostics["ess"].to_numpy()
    num_particles = getattr(results.tracker, "num_particles", 0)
    num_particles = int(num_particles or np.nanmax(sizes, initial=1))
    sizes = sizes[sizes > 0]  # 0 while there is no object, or where no particle explains the frame
    ess = float(np.median(sizes)) if len(sizes) else None
    impossible = int(np.isneginf(diagnostics["log_evidence"]).sum())
    content = _summary(results, table, verdicts, ess, impossible)
    write_text(output / SUMMARY, json.dumps(content, indent=2) + "\n")
    lost = {name: about["lost"] for name, about in verdicts.items()}
    target = request.target
    columns = [name for name in target.columns if name not in target.fixed_columns]
    figure = plotting.trajectories(table, columns, lost)
    plotting.save_figure(figure, output / "trajectories.png")
    for line in _lines(results, content, sentences(verdicts, ess, num_particles, target.place)):
        say(line)
    for warning in _warnings(results, impossible):
        say(warning, err=True)
    if truth is not None:
        compare = _scores_of_boxes if request.detector is None else _scores_of_identities
        found = compare(results, _boxes(table), truth)
        text = found.to_csv(index=False, float_format="%.6g", na_rep="nan")
        write_text(output / "metrics.csv", text)


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


def _frames(stretches: list[list[int]]) -> str:
    texts = [f"{first} to {last}" if last > first else f"{first}" for first, last in stretches]
    shown = texts[:4] + ([f"{len(texts) - 4} more stretches"] if len(texts) > 4 else [])
    return " and ".join([", ".join(shown[:-1]), shown[-1]]) if len(shown) > 1 else shown[0]


def _summary(
    results: Results,
    table: pd.DataFrame,
    verdicts: dict[str, dict[str, Any]],
    ess: float | None,
    impossible: int,
) -> dict[str, Any]:
    request, source, stopped = results.request, results.source, results.stopped
    first, rest = results.seconds
    number = request.run.start
    frames = slice(number, max(number, results.last) + 1)
    start, names = results.starts[number], results.names
    model_errors = calls.model_error(results.filter, len(start.ids)).round(4).tolist()
    return {
        "parameters": {
            name: str(value) if isinstance(value, Path) else value
            for name, value in request.table(source.path).items()
        },
        # Of the likelihood, if it reports one; else the requested method.
        "likelihood_method": None
        if request.run.tracker
        else getattr(results.filter.likelihood, "method", request.options.get("likelihood")),
        # The error that the model declares, such as its slip: of x, y and log size.
        "model_error": dict(zip(map(str, start.ids.tolist()), model_errors, strict=True)),
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
        "remarks": list(start.remarks),
        "frames_outside": results.outside,
        "frames_without_likelihood": results.without_likelihood,
        "mean_mc_error": _mean_mc_errors(table, names),
        "impossible_frames": impossible,
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


def _scores_of_boxes(results: Results, boxes: BoxTable, truth: BoxTable) -> pd.DataFrame:
    """Print and return metrics by object over the frames with ground truth.

    A later frame in which the user gave an object's box does not count for that object, nor does
    any frame before the object starts.
    """
    start = results.request.run.start
    first, last = start + results.resumed + 1, results.last
    shared = [int(name) for name in results.names if name in set(truth.id.tolist())]
    estimate, target = (dense(each, shared, last + 1)[first:] for each in (boxes, truth))
    for place, name in enumerate(shared):
        given = [at for at, each in results.starts.items() if name in each.ids and at <= last]
        target[[at - first for at in given if at >= first], place] = np.nan
        target[: max(min(given, default=start) - first, 0), place] = np.nan
    measures = metrics.summarise(estimate[None], target)
    columns = {
        "id": shared,
        "frames": np.asarray(is_proper(target)).sum(axis=0),
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
    return found


def _scores_of_identities(results: Results, boxes: BoxTable, truth: BoxTable) -> pd.DataFrame:
    """Print and return identity scores of objects that come and go."""
    first, count = results.request.run.start + results.resumed + 1, results.tracked
    estimates, targets = (
        dense(each, sorted(set(each.id.tolist())), first + count)[first:] for each in (boxes, truth)
    )
    values = scores.tracking_scores(estimates, targets)
    row = [f"{values[name]:.3f}" for name in _SCORES] + [f"{values[n]:.0f}" for n in _COUNTS]
    title = f"Against the truth, {counted(count)}"
    print_table(title, ["", *_SCORES, *_COUNTS], [["all", *row]])
    return pd.DataFrame([values])


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


def _warnings(results: Results, impossible: int) -> list[str]:
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
    if impossible:
        lines.append(
            f"Warning: {counted(impossible)} had likelihood zero for all particles and "
            "counted as missing."
        )
    if results.invalid:
        number = results.invalid
        lines.append(f"Warning: {number} likelihood(s) were not a number and counted as zero.")
    if detector is not None and not changes["started"] and not changes["refused"]:
        lines.append(f"Note: {detector.why_none_started(results.request.run.start)}")
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
