"""The analogue of tables 3 and 4: people who walk behind one another (tud_campus).

The paper's real sequences are not to be had.  This one has five people to track, of whom three
are fully hidden for a while; the tracker is that of the paper with more motion, for people here
walk faster, and its particles are reduced in a second round, for DPS to starve as in table 4.
"""

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jaxpf.contract.errors import InputError
from jaxpf.evaluation.opening import load_scene
from jaxpf.measures import metrics
from jaxpf.papers import paper
from jaxpf.papers.judging.claims import Measured
from jaxpf.papers.measuring.grid import run_grid, run_keys
from jaxpf.papers.smith2004.scenes import all_orderings

CLIP = "tud_campus"
IDS = (1, 2, 3, 4, 5)
SHARPNESS = 20.0
SCALE = (4.0, 2.0, 0.003)
#: N: enough for all methods, and so few that a component of DPS has 12 particles.
PARTICLES = (300, 60)

MEASURES = ("success", "recovery", "precision", "recall")


class Tracked(NamedTuple):
    """What happened to one object at one N.

    Attributes:
        particles: N.
        identity: the annotation's number of the object.
        hidden: whether it is fully hidden for a while.
        runs: R.
        successes: method -> runs that tracked it throughout.
        recoveries: method -> runs that tracked it in the last annotated frame.
        precision: method -> over the frames with T = 1, percent.
        recall: method -> over the frames with T = 1, percent.
    """

    particles: int
    identity: int
    hidden: bool
    runs: int
    successes: dict[str, int]
    recoveries: dict[str, int]
    precision: dict[str, Measured]
    recall: dict[str, Measured]


def measure(
    data: Path,
    runs: int,
    seed: int,
    particles: Sequence[int] = PARTICLES,
    name: str = CLIP,
    **settings: Any,
) -> list[Tracked]:
    """Track the clip with every method at every N.

    Args:
        data: a folder that holds ``tud_campus``, or ``tud_campus`` itself.
        runs: of each method.
        seed: of the runs.
        particles: values of N.
        name: under which results are kept; see ``jaxpf.papers.measuring.checkpoints``.
        settings: further ones of ``run_grid``.

    Raises:
        InputError: the clip is not there or cannot be read.
    """
    import jax

    folder = clip_folder(data)
    scene = load_scene(str(folder), ids=IDS, start_frame=0)
    hidden = hidden_objects(folder)
    orderings = all_orderings(len(IDS))
    # Every device takes its share of the runs, as if on a scene of its own.
    shares = max(min(jax.local_device_count(), runs), 1)
    width = -(-runs // shares)
    numbers = np.minimum(np.arange(shares * width), runs - 1).reshape(shares, width)
    keys = [run_keys(seed, share) for share in numbers]
    found = []
    for count in particles:
        results = list(
            run_grid(
                [scene] * shares,
                keys,
                orderings,
                [SHARPNESS],
                num_particles=count,
                scale=SCALE,
                name=f"{name}-{count}-{runs}",
                **settings,
            )
        )
        boxes = np.concatenate([result.boxes[:, 0] for result in results], axis=1)[:, :runs]
        found += [
            _tracked(boxes, scene.boxes[1:], tuple(orderings), count, identity, identity in hidden)
            for identity in IDS
        ]
    return found


def clip_folder(data: Path) -> Path:
    """The clip's folder; ``InputError`` if it is not there."""
    return paper.clip_folder(data, CLIP)


def hidden_objects(folder: Path) -> list[int]:
    """Tracked objects that are fully hidden for a while, by the clip's ``events.csv``."""
    path = folder / "events.csv"
    try:
        with open(path, newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        hidden = {int(row["occluded_id"]) for row in rows if float(row["max_fraction"]) >= 1}
    except (OSError, KeyError, TypeError, ValueError) as error:
        raise InputError(
            f"cannot read the occlusions from '{path}': {error}; it needs the columns "
            "occluded_id and max_fraction."
        ) from None
    return sorted(hidden & set(IDS))


def _tracked(
    boxes: np.ndarray,
    truth: np.ndarray,
    names: tuple[str, ...],
    particles: int,
    identity: int,
    hidden: bool,
) -> Tracked:
    """``boxes`` ``[O, R, T, P, 4]``."""
    place = IDS.index(identity)
    one, true = boxes[..., place : place + 1, :], truth[:, place : place + 1]
    successes = np.asarray(metrics.success(one, true))[..., 0].sum(axis=1)
    recoveries = np.asarray(metrics.recovery(one, true))[..., 0].sum(axis=1)
    quality: list[dict[str, Measured]] = []
    for share in (metrics.precision, metrics.recall):
        tracked = np.asarray(metrics.track_state(one, true))
        values = np.asarray(share(one, true))
        by_method = {}
        for k, name in enumerate(names):
            interval = metrics.mean_interval(
                metrics.masked_mean(values[k], tracked[k], (1, 2)), tracked[k].sum(axis=(1, 2))
            )
            by_method[name] = Measured(
                *(100 * float(x) for x in (interval.value, interval.lower, interval.upper))
            )
        quality.append(by_method)
    return Tracked(
        particles=particles,
        identity=identity,
        hidden=hidden,
        runs=boxes.shape[1],
        successes=dict(zip(names, successes.tolist(), strict=True)),
        recoveries=dict(zip(names, recoveries.tolist(), strict=True)),
        precision=quality[0],
        recall=quality[1],
    )
