"""The last step of ``jaxpf track``: summary, plots, verdicts and metrics."""

import contextlib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from jaxpf import contract
from jaxpf.cli.shared.console import say
from jaxpf.cli.tracking import against_truth
from jaxpf.cli.tracking.detector import why_none_started
from jaxpf.cli.tracking.session import Session
from jaxpf.cli.tracking.verdict import object_verdicts, sentences
from jaxpf.contract.errors import InputError
from jaxpf.files import writing
from jaxpf.files.digests import SUMMARY, digests
from jaxpf.files.versions import versions
from jaxpf.media import plotting

#: Tables whose rows the summary counts.
_TABLES = ("tracks.csv", "outlines.csv")


def finish(session: Session) -> None:
    """Write summary and plots, print the verdicts, and raise the error that ended the run early."""
    if session.is_kept:
        # The tracks so far are kept; an error here must not hide the first one.
        with contextlib.suppress(*([] if session.stopped is None else [InputError])):
            _finish(session)
    if session.stopped is not None:
        raise session.stopped


def _finish(session: Session) -> None:
    output = session.output
    assert session.tracks is not None
    table, sizes = session.tracks.table, np.array(session.ess)
    names = session.names.tolist()
    if session.population is not None:
        names = [new["id"] for new in session.population.started]
    verdicts = object_verdicts(table, names)
    num_particles = getattr(session.tracker, "num_particles", 0)
    num_particles = int(num_particles or np.nanmax(sizes, initial=1))
    sizes = sizes[sizes > 0]  # 0 while there is no object, or where no particle explains the frame
    ess = float(np.median(sizes)) if len(sizes) else None
    content = _summary(session, names, verdicts, table, ess)
    writing.write_text(output / SUMMARY, json.dumps(content, indent=2) + "\n")
    lost = {name: about["lost"] for name, about in verdicts.items()}
    target = session.request.target
    columns = [name for name in target.columns if name not in target.fixed_columns]
    figure = plotting.trajectories(table, columns, lost)
    plotting.save_figure(figure, output / "trajectories.png")
    _tell(session, verdicts, content, ess, num_particles)
    if session.truth is None:
        return
    first, count = session.request.run.start + session.before[1], session.counts.tracked
    if session.population is not None:
        against_truth.report_identities(output, first, count, table, session.truth)
        return
    given = {at: each.ids.tolist() for at, each in session.later.items()}
    late = set(names) - set(session.start.ids.tolist())
    against_truth.report_truth(output, table, names, first, session.truth, given=given, late=late)


def _summary(
    session: Session,
    names: Sequence[object],
    verdicts: dict[str, dict[str, Any]],
    table: dict[str, np.ndarray],
    ess: float | None,
) -> dict[str, Any]:
    counts, source = session.counts, session.source
    population, stopped = session.population, session.stopped
    first, rest = session.seconds
    start = session.request.run.start
    frames = slice(start, max(start, counts.last) + 1)
    kept = {} if population is None else vars(population)
    started = session.start.ids.tolist()
    model_errors = contract.model_error(session.filter, len(started))
    return {
        "parameters": {
            name: str(value) if isinstance(value, Path) else value
            for name, value in session.table.items()
        },
        "likelihood_method": _likelihood_method(session),
        # The error that the model declares, such as its slip: of x, y and log size.
        "model_error": dict(zip(map(str, started), model_errors.round(4).tolist(), strict=True)),
        "ids": names,
        **kept,
        "objects": verdicts,
        "effective_sample_size": None if ess is None else round(ess, 3),
        "frames_tracked": counts.tracked,
        "width": source.width,
        "height": source.height,
        "fps": source.fps,
        "interrupted": isinstance(stopped, KeyboardInterrupt),
        "error": str(stopped) if isinstance(stopped, InputError) else None,
        "video_truncated": source.truncated,
        "video_note": source.note,
        "remarks": list(session.start.remarks),
        "frames_outside": counts.outside,
        "frames_without_likelihood": counts.without_likelihood,
        "mean_mc_error": _mean_mc_errors(table, names),
        "impossible_frames": counts.impossible,
        "invalid_likelihoods": counts.invalid,
        "seconds_first_frame": round(first, 3),
        "seconds_other_frames": round(rest, 3),
        "frames_per_second": round((counts.tracked - 1) / rest, 2) if rest > 0 else None,
        "versions": versions(),
        "tables": digests(session.output, _TABLES),
        # Of the start frame and all that follow.
        "times": [round(source.shown_at(n), 4) for n in range(frames.start, frames.stop)],
        "pictures": source.pictures and source.pictures[frames],
    }


def _mean_mc_errors(
    table: dict[str, np.ndarray], names: Sequence[object]
) -> dict[str, float | None] | None:
    """Mean Monte Carlo standard error of x and y in pixels by object; None unless requested."""
    if "x_mc_error" not in table:
        return None
    ids = np.array([str(name) for name in table["id"].tolist()])
    errors = np.stack([table["x_mc_error"], table["y_mc_error"]])
    means = {}
    for name in map(str, names):
        values = errors[:, ids == name]
        estimated = np.isfinite(values)
        means[name] = round(float(values[estimated].mean()), 4) if estimated.any() else None
    return means


def _likelihood_method(session: Session) -> str | None:
    """Method of the likelihood, if it reports one; else the requested method."""
    if session.request.run.tracker:
        return None
    requested = getattr(session.request.model, "likelihood", None)
    return getattr(session.filter.likelihood, "method", requested)


def _tell(
    session: Session,
    verdicts: dict[str, dict[str, Any]],
    content: dict[str, Any],
    ess: float | None,
    num_particles: int,
) -> None:
    counts, rate = session.counts, content["frames_per_second"]
    speed = "" if rate is None else f", {rate:.1f} frames/s"
    say(f"{session.output}: {counted(counts.tracked)} tracked{speed}")
    place = session.request.target.place
    for line in sentences(verdicts, ess, num_particles, place):
        say(line)
    if (errors := content["mean_mc_error"]) is not None:
        estimated = [f"{name} {error:.2g}" for name, error in errors.items() if error is not None]
        say(f"Mean Monte Carlo standard error of x and y in pixels: {', '.join(estimated)}")
    if session.source.note:
        _warn(f"Note: {session.source.note}")
    for where, frames_of in (
        ("was outside the picture", counts.outside),
        ("had likelihood zero for all its particles", counts.without_likelihood),
    ):
        for name, frames in frames_of.items():
            if frames:
                _warn(
                    f"Lost: object {name} {where} in {counted(len(frames))}, first in frame "
                    f"{frames[0]}."
                )
    if counts.impossible:
        _warn(
            f"Warning: {counted(counts.impossible)} had likelihood zero for all particles and "
            "counted as missing."
        )
    if counts.invalid:
        _warn(f"Warning: {counts.invalid} likelihood(s) were not a number and counted as zero.")
    if session.population is not None:
        population = session.population
        came = counted(len(population.started), "object")
        say(f"{came} came, {len(population.ended)} went")
        detector = session.request.detector
        if detector is not None and not population.started and not population.refused:
            _warn(f"Note: {why_none_started(detector, session.request.run.start)}")
        if population.refused:
            refusal = population.refused[0]
            _warn(
                f"Refused: {len(population.refused)} that could not start, first in frame "
                f"{refusal['frame']}: {refusal['reason']}"
            )


def _warn(text: str) -> None:
    say(text, err=True)


def counted(count: int, noun: str = "frame") -> str:
    """``1 frame``, ``2 frames``."""
    return f"{count} {noun}{'' if count == 1 else 's'}"
