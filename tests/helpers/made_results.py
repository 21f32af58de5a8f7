"""Evaluations whose every box is known: written like real ones, without running a tracker."""

import dataclasses

import numpy as np

from jaxpf.evaluation import Results
from jaxpf.evaluation.results import FOLDER, Batch, Configuration, batch_name
from jaxpf.evaluation.tables import intervals
from jaxpf.files.store import Store
from jaxpf.targets import Start

PARAMETERS = {"sharpness": 20.0, "noise_pixels": (2.0, 4.0, 0.5), "num_particles": 100}
SIR = Configuration("SIR", "", PARAMETERS)
PS = Configuration("PS", "21", PARAMETERS)
DPS = Configuration("DPS", "shifts", PARAMETERS)
#: With a name that must be escaped.
OTHER = Configuration("a|b <i>_100%$x$", kind="imported")


def batch(boxes, first_run=0, **given):
    """R runs from ``boxes [R, T, P, 4]``; everything else as given, or the same everywhere."""
    boxes = np.asarray(boxes, np.float32)
    runs, frames, objects = boxes.shape[:3]

    def filled(name, value, *shape):
        return np.broadcast_to(np.float32(given.get(name, value)), shape)

    return Batch(
        seeds=np.full(runs, 7),
        runs=first_run + np.arange(runs),
        shapes=boxes,
        distinct_share=filled("distinct_share", 0.5, runs, frames, objects),
        spread=filled("spread", 2.0, runs, frames, objects, 3),
        model_error=filled("model_error", 0.0, runs, objects, 3),
        confidence=filled("confidence", 0.7, runs, frames, objects),
        ess=filled("ess", 30.0, runs, frames),
        log_evidence=filled("log_evidence", -1.5, runs, frames),
        without_likelihood=np.broadcast_to(
            given.get("without_likelihood", False), (runs, frames, objects)
        ),
    )


def imported(boxes):
    """The one batch of imported tracks ``[T, P, 4]``."""
    nothing = dict.fromkeys(
        ("distinct_share", "spread", "confidence", "ess", "log_evidence"), np.nan
    )
    return batch(
        np.asarray(boxes)[None], without_likelihood=np.isnan(boxes).any(axis=-1), **nothing
    )


def make(folder, batches, truth, runs=None, ids=None, start_frame=0, grid=None):
    """Write an evaluation and open it.

    Args:
        folder: a new one.
        batches: configurations, each with its list of batches.
        truth: ``[T, P, 4]``.
        runs: that were asked for; by default as many as there are.
        ids: of the objects; 1, 2, ... by default.
        start_frame: of the scene.
        grid: values that were asked for, by parameter.
    """
    (folder / FOLDER).mkdir(parents=True)
    for index, (_, parts) in enumerate(batches):
        for part in parts:
            Store(folder / FOLDER).write(batch_name(index, int(part.runs[0])), vars(part))
    finished = max(sum(map(len, parts)) for _, parts in batches)
    settings = {
        "runs": finished if runs is None else runs,
        "asked": {"seed": 7, "tracks": {"<script>": "&"}, "grid": grid or {}},
        "versions": {"jaxpf": "0"},
        "scene": {
            "name": "made <scene>",
            "target": "boxes",
            "object_ids": list(ids or range(1, truth.shape[1] + 1)),
            "start_frame": start_frame,
            "fps": 10.0,
        },
        "configurations": [dataclasses.asdict(configuration) for configuration, _ in batches],
    }
    truth = np.asarray(truth, np.float64)
    first = np.broadcast_to([10.0, 10.0, 20.0, 30.0], truth.shape[1:])
    ids = np.array(settings["scene"]["object_ids"])
    start = Start(ids, first, first[:, 2:], (-1,) * len(ids))
    return Results(folder, settings, truth, start)


def value(overview, configuration, measure, of="all"):
    """The estimate of a measure of the configuration with an index."""
    return intervals(overview.estimates, measure, str(of), [configuration])[0, 0]


def walks(seed, runs, frames, objects):
    """Truth ``[T, P, 4]`` of boxes 20 x 30 that walk, and noisy estimates ``[R, T, P, 4]``."""
    random = np.random.default_rng(seed)
    path = np.cumsum(random.normal(0, 2, (frames, objects, 2)), axis=0) + 40
    truth = np.concatenate([path, np.broadcast_to([20.0, 30.0], path.shape)], axis=-1)
    error = np.cumsum(random.normal(0, 6, (runs, frames, objects, 2)), axis=1)
    boxes = np.broadcast_to(truth, (runs, *truth.shape)).copy()
    boxes[..., :2] += error
    return truth, boxes
