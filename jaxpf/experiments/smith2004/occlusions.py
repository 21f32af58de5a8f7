"""The analogue of tables 3 and 4: people who walk behind one another (tud_campus).

The paper's real sequences are not to be had.  This one has five people to track, of whom three
are fully hidden for a while; the tracker is that of the paper with more motion, for people here
walk faster, and its particles are reduced in a second round, for DPS to starve as in table 4.
"""

import csv
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from jaxpf.errors import InputError
from jaxpf.experiments.claims import (
    Claim,
    Measured,
    Quantity,
    judged,
    newcombe,
    wilson,
)
from jaxpf.experiments.comparison_table import Cell, Table
from jaxpf.experiments.grid import run_grid, run_keys
from jaxpf.experiments.smith2004.published import REAL
from jaxpf.experiments.smith2004.synthetic import all_orderings
from jaxpf.experiments.sources import load_scene
from jaxpf.measures import metrics

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
    particles: tuple[int, ...] = PARTICLES,
    progress: Callable[[int], None] = lambda done: None,
) -> list[Tracked]:
    """Track the clip with every method at every N.

    Args:
        data: a folder that holds ``tud_campus``, or ``tud_campus`` itself.
        runs: of each method.
        seed: of the runs.
        particles: values of N.
        progress: called with the number of values of N done.

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
    for done, count in enumerate(particles, start=1):
        results = list(
            run_grid(
                [scene] * shares, keys, orderings, [SHARPNESS], num_particles=count, scale=SCALE
            )
        )
        boxes = np.concatenate([result.boxes[:, 0] for result in results], axis=1)[:, :runs]
        found += [
            _tracked(boxes, scene.boxes[1:], tuple(orderings), count, identity, identity in hidden)
            for identity in IDS
        ]
        progress(done)
    return found


def clip_folder(data: Path) -> Path:
    """The clip's folder.

    Raises:
        InputError: it is not there.
    """
    folder = data if data.name == CLIP else data / CLIP
    if not folder.is_dir():
        raise InputError(
            f"the folder '{data}' holds no {CLIP}; name one that does, or leave out --data."
        )
    return folder


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


def tables(outcomes: Sequence[Tracked]) -> list[Table]:
    """As tables 3 and 4 for each hidden object and N, then all objects in short."""
    return [
        *(_table(outcome) for outcome in outcomes if outcome.hidden),
        *(
            _overview([outcome for outcome in outcomes if outcome.particles == count])
            for count in dict.fromkeys(outcome.particles for outcome in outcomes)
        ),
    ]


def _overview(outcomes: Sequence[Tracked]) -> Table:
    """Success of every object."""
    rows: list[tuple[str, list[Cell | str]]] = [
        (
            name,
            [Cell(None, _rate(outcome.successes[name], outcome.runs)) for outcome in outcomes],
        )
        for name in outcomes[0].successes
    ]
    return Table(
        f"real_{CLIP}_n{outcomes[0].particles}",
        f"{CLIP}: success of all objects, {outcomes[0].particles} particles (%)",
        [
            "method",
            *(
                f"object {outcome.identity}{' (hidden)' if outcome.hidden else ''}"
                for outcome in outcomes
            ),
        ],
        rows,
    )


def _table(outcome: Tracked) -> Table:
    """A row for every method."""
    rows: list[tuple[str, list[Cell | str]]] = [
        (
            name,
            [
                Cell(None, _rate(outcome.successes[name], outcome.runs)),
                Cell(None, _rate(outcome.recoveries[name], outcome.runs)),
                Cell(None, outcome.precision[name]),
                Cell(None, outcome.recall[name]),
            ],
        )
        for name in outcome.successes
    ]
    return Table(
        f"real_{CLIP}_object_{outcome.identity}_n{outcome.particles}",
        f"As tables 3 and 4: {CLIP}, hidden object {outcome.identity}, {outcome.particles} "
        "particles (%)",
        ["method", *MEASURES],
        rows,
    )


def _rate(count: int, runs: int) -> Measured:
    return Measured(100 * count / runs, *wilson(count, runs)(0.95))


def claims(outcomes: Sequence[Tracked]) -> list[Claim]:
    """The conclusions of section 5.2, judged on the hidden objects."""
    outcomes = [outcome for outcome in outcomes if outcome.hidden]
    if not outcomes:
        return []
    largest = max(outcome.particles for outcome in outcomes)
    enough = [outcome for outcome in outcomes if outcome.particles == largest]
    few = [outcome for outcome in outcomes if outcome.particles != largest]
    found = [
        judged(
            f"Real occlusions, {largest} particles: DPS recovers the hidden object more often than "
            "PS on average",
            "5.2, table 3",
            _published("RealSeq1", "RealSeq2"),
            [_dps_over_ps(outcome, at_least=0) for outcome in enough],
        ),
        judged(
            f"Real occlusions, {largest} particles: the best order of PS recovers it more often "
            "than the worst",
            "5.2, table 3",
            _published("RealSeq1", "RealSeq2"),
            [_best_over_worst(outcome) for outcome in enough],
        ),
    ]
    for count in sorted({outcome.particles for outcome in few}, reverse=True):
        chosen = [outcome for outcome in few if outcome.particles == count]
        found.append(
            judged(
                f"With few particles per component DPS starves: at N = {count} it recovers the "
                "hidden object less often than PS on average",
                "5.2, table 4",
                _published("RealSeq3"),
                [_dps_over_ps(outcome, at_most=0) for outcome in chosen],
            )
        )
    return found


def _published(*sequences: str) -> str:
    pieces = []
    for sequence in sequences:
        rows = REAL[sequence]
        orders = "/".join(f"{row.recovery:g}" for name, row in rows.items() if "PS " in name)
        pieces.append(
            f"{sequence} recovery: Non-PS {rows['Non-PS'].recovery:g}, PS {orders}, "
            f"DPS {rows['DPS'].recovery:g}"
        )
    return "; ".join(pieces)


def _orders(outcome: Tracked) -> list[str]:
    return [name for name in outcome.recoveries if name.startswith("PS ")]


def _dps_over_ps(outcome: Tracked, **claimed: float) -> Quantity:
    orders = _orders(outcome)
    total = sum(outcome.recoveries[name] for name in orders)
    runs = outcome.runs * len(orders)
    counts = outcome.recoveries["DPS"], total
    value = 100 * (counts[0] / outcome.runs - total / runs)
    interval = newcombe(counts, (outcome.runs, runs))
    return Quantity(f"object {outcome.identity}", value, interval, **claimed)


def _best_over_worst(outcome: Tracked) -> Quantity:
    """Corrected for having chosen the extremes among all pairs of orders (Bonferroni)."""
    orders = _orders(outcome)
    rates = [outcome.recoveries[name] for name in orders]
    counts = max(rates), min(rates)
    interval = newcombe(counts, (outcome.runs, outcome.runs))
    pairs = len(orders) * (len(orders) - 1)
    return Quantity(
        f"object {outcome.identity}",
        100 * (counts[0] - counts[1]) / outcome.runs,
        lambda level: interval(1 - (1 - level) / pairs),
        at_least=0,
    )
