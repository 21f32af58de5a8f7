"""The analogue of tables 3 and 4: people who walk behind one another (tud_campus).

The paper's real sequences are not available.  This clip has five people, three of whom are fully
hidden for a while.  The tracker is the paper's with more process noise, because people walk faster
here.  It runs at two numbers of particles; with the smaller one DPS may starve, as in table 4.
"""

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jaxpf.contract.errors import InputError
from jaxpf.evaluation.opening import load_scene
from jaxpf.evaluation.work.worker import run_keys
from jaxpf.measures import metrics
from jaxpf.papers import paper
from jaxpf.papers.smith2004.grid import run_grid
from jaxpf.papers.smith2004.scenes import all_orderings

CLIP = "tud_campus"
IDS = (1, 2, 3, 4, 5)
SHARPNESS = 20.0
SCALE = (4.0, 2.0, 0.003)
#: N: enough for all methods, and so small that a component of DPS has 12 particles.
PARTICLES = (300, 60)

MEASURES = ("success", "recovery", "precision", "recall")


class Tracked(NamedTuple):
    """Results for one object at one N.

    Attributes:
        particles: N.
        identity: number of the object in the annotation.
        hidden: whether it is fully hidden for a while.
        success: method -> ``[R]`` bool, the run tracked it throughout.
        recovered: method -> ``[R]`` bool, the run tracked it in the last annotated frame.
        precision: method -> ``[R]``, over the frames with T = 1, per cent; NaN if there are none.
        recall: as ``precision``.
    """

    particles: int
    identity: int
    hidden: bool
    success: dict[str, np.ndarray]
    recovered: dict[str, np.ndarray]
    precision: dict[str, np.ndarray]
    recall: dict[str, np.ndarray]

    def orders(self) -> list[np.ndarray]:
        """``recovered`` of every order of PS."""
        return [runs for name, runs in self.recovered.items() if name.startswith("PS ")]


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
        runs: number of runs per method.
        seed: seed of the runs.
        particles: values of N.
        name: name under which results are stored; see ``jaxpf.papers.checkpoints``.
        settings: further arguments of ``run_grid``.

    Raises:
        InputError: the clip does not exist or cannot be read.
    """
    import jax

    folder = clip_folder(data)
    scene = load_scene(str(folder), ids=IDS, start_frame=0)
    hidden = hidden_objects(folder)
    orderings = all_orderings(len(IDS))
    # Divide the runs among the devices, as if each had its own scene.
    shares = max(min(jax.local_device_count(), runs), 1)
    width = -(-runs // shares)
    numbers = np.minimum(np.arange(shares * width), runs - 1).reshape(shares, width)
    keys = list(run_keys(seed, 0, runs)[numbers])
    outcomes = []
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
        outcomes += [
            _tracked(boxes, scene.boxes[1:], tuple(orderings), count, identity, identity in hidden)
            for identity in IDS
        ]
    return outcomes


def clip_folder(data: Path) -> Path:
    """The clip's folder; raises ``InputError`` if it does not exist."""
    return paper.clip_folder(data, CLIP)


def hidden_objects(folder: Path) -> list[int]:
    """Tracked objects that are fully hidden for a while, according to the clip's ``events.csv``."""
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
    """Results for one object from ``boxes`` ``[O, R, T, P, 4]``."""
    place = IDS.index(identity)
    estimate, true = boxes[..., place : place + 1, :], truth[:, place : place + 1]
    tracked = np.asarray(metrics.track_state(estimate, true))
    columns = [
        np.asarray(metrics.success(estimate, true))[..., 0],
        np.asarray(metrics.recovery(estimate, true))[..., 0],
        *(
            100 * np.asarray(metrics.masked_mean(share(estimate, true), tracked, (-2, -1)))
            for share in (metrics.precision, metrics.recall)
        ),
    ]
    by_method = [dict(zip(names, column, strict=True)) for column in columns]
    return Tracked(particles, identity, hidden, *by_method)
