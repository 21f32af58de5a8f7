"""smith2004: published figures, verdicts and their statistics, other endings of a frame, runs."""

import csv
import dataclasses
import functools
import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from command_line import jaxpf as program
from judged import verdicts

import jaxpf
import scenes as drawn
from jaxpf import measures
from jaxpf.dynamics import LinearGaussian
from jaxpf.evaluation.engine import local_pool, run_keys
from jaxpf.likelihoods import Gaussian
from jaxpf.papers.checkpoints import UNSTORED, keeping
from jaxpf.papers.judging.claims import NOT_SEEN, OPEN, SUPPORTED
from jaxpf.papers.smith2004 import scenes
from jaxpf.papers.smith2004.scenes import (
    NUM_OBJECTS,
    SHARPNESS,
    OtherEnding,
    Outcome,
    scene_tracker,
)
from jaxpf.papers.smith2004.study import PAPER, best_and_worst, figure_4, study_of
from jaxpf.shapes import boxes_from_substates

# Published figures

PUBLISHED = {each["name"]: each["published"] for each in PAPER.declared["tables"]}
TABLE_1 = {name: PUBLISHED[f"table_1_{name}"] for name in ("success", "precision", "recall")}
TABLE_2 = {name: PUBLISHED[f"table_2_{name}"] for name in ("recovery", "precision", "recall")}

# A second transcription, in the order in which one reads the paper's rows.
ROWS_1 = """97,69/69 100,90/87 100,91/86
            97,69/68 100,91/87 100,90/86
            93,68/68 100,91/88 100,90/87
            96,67/66 100,91/88 100,90/87"""
ROWS_2 = """2|19|10|42 27/28|27/26|17/16|41/36
            2|18|8|34  21/21|24/24|16/16|36/36
            0|21|16|38 23/22|30/29|18/17|21/22
            2|21|12|36 24/23|28/28|25/24|23/23"""


def numbers(text):
    return [float(number) for number in re.findall(r"\d+", text)]


def test_the_tables_are_the_papers():
    for row, line in enumerate(ROWS_1.splitlines()):
        methods = ("Non-PS", "PS", "DPS")
        measures = ("success", "precision", "recall")
        assert numbers(line) == [TABLE_1[what][how][row] for how in methods for what in measures]
    methods, qualities = ("Non-PS", "PS mean", "PS worst", "DPS"), ("precision", "recall")
    for row, line in enumerate(ROWS_2.splitlines()):
        recovery = [TABLE_2["recovery"][method][row] for method in methods]
        quality = [TABLE_2[what][method][row] for method in methods for what in qualities]
        assert numbers(line) == recovery + quality


def test_other_figures_follow_from_the_tables():
    """Section 3.2: 22 points of precision (20 to 40) and 19.75 of recall (20 to 50)."""
    precision, recall = (
        np.subtract(TABLE_1[measure]["PS"], TABLE_1[measure]["Non-PS"])
        for measure in ("precision", "recall")
    )
    assert (precision[:3].mean(), recall.mean()) == (22, 19.75)
    ps, dps, best, worst = (
        TABLE_2["recovery"][name] for name in ("PS mean", "DPS", "PS best", "PS worst")
    )
    published = PUBLISHED["conditions"]
    assert published["PS"] == np.mean(ps)
    assert published["DPS - PS"] == np.mean(dps) - np.mean(ps)
    assert published["best - worst order"] == best[1] - worst[1]


# Verdicts


def outcome_of(recovery, scenes_=10, seed=0):
    """An outcome in which the methods recover with given rates, all else alike."""
    names = tuple(scenes.all_orderings())
    rng = np.random.default_rng(seed)
    shape = (scenes_, len(names), len(SHARPNESS))
    rates = np.array([recovery[name if name in recovery else name.split()[0]] for name in names])
    recovered = rng.uniform(size=shape) < rates[:, None]
    share = np.clip(0.9 + 0.01 * rng.normal(size=shape), 0, 1)
    return Outcome(
        names,
        recovered=recovered,
        success=np.ones(shape),
        precision=share,
        recall=share,
        leader_precision=share,
        leader_recall=share,
        uniqueness=np.full((*shape, NUM_OBJECTS), 0.5) + 0.01 * rng.normal(size=(*shape, 7)),
        dynamics=np.ones((*shape, NUM_OBJECTS, 2)),
    )


RATES = {"Non-PS": 0.0, "PS": 0.3, "DPS": 0.4, "SPS": 0.7}
ORDERS = [name for name in scenes.all_orderings() if name.startswith("PS ")]


def tables(outcome, conditions=None):
    return {table.name: table for table in PAPER.tables(study_of(outcome, conditions or {}))}


def test_verdicts_follow_the_recovery_rates():
    def judged(*rates, **made):
        outcome = outcome_of(dict(zip(RATES, rates, strict=True)), **made)
        return verdicts(PAPER, study_of(outcome, {}))

    clear = judged(0.02, 0.2, 0.7, 0.9, scenes_=1250)
    reverse = judged(0.7, 0.4, 0.1, 0.9, scenes_=1250)
    same = judged(0.3, 0.3, 0.3, 0.3, scenes_=40)
    for key in ("ps_recovers", "dps_recovers_each"):
        assert (clear[key], reverse[key], same[key]) == (SUPPORTED, NOT_SEEN, OPEN)


def test_orders_that_differ_are_told_from_luck():
    alike = outcome_of(RATES, scenes_=20)
    # The worst of seven equal orders looks far below the best, on the scenes that chose them.
    rates = alike.recovered[:, alike.of("PS"), 0].mean(axis=0)
    assert rates.max() - rates.min() > 0.1
    assert verdicts(PAPER, study_of(alike, {}))["orders"] != SUPPORTED
    far = {**RATES, **dict(zip(ORDERS, np.linspace(0.02, 0.8, 7), strict=True))}
    assert verdicts(PAPER, study_of(outcome_of(far, scenes_=80), {}))["orders"] == SUPPORTED


def test_worst_and_best_are_those_of_the_recovery_rate():
    rates = dict(zip(ORDERS, [0.5, 0.5, 0.0, 0.5, 1.0, 0.5, 0.5], strict=True))
    recovery = tables(outcome_of({**RATES, **rates}))["table_2_recovery"]
    cells = dict(zip(recovery.columns[1:], recovery.rows[0][1], strict=True))
    assert cells["PS worst"].measured.value == 0
    assert cells["PS best"].measured.value == 100
    assert cells["PS worst"].published == 10
    assert cells["PS best"].published is None
    assert recovery.rows[1][1][3].published == 38
    assert cells["SPS"].published is None


def test_uniqueness_is_read_by_stage():
    """Object (shift + stage) stands at that stage of the order that begins with ``shift``."""
    outcome = outcome_of(RATES)
    assert len(figure_4(outcome).axes) == 15
    for shift, place in enumerate(outcome.of("PS")):
        for stage, partition in enumerate(scenes.shifted(shift)):
            outcome.uniqueness[:, place, 0, partition] = 0.01 * (stage + 1)
    values = [cells[0].measured.value for _, cells in tables(outcome)["uniqueness"].rows]
    np.testing.assert_allclose(values, np.arange(1, 8))


def test_orders_are_told_by_the_stage_of_object_1():
    rates = dict.fromkeys([*ORDERS, *RATES], 0.0) | {"PS 2,3,4,5,6,7,1": 1.0}
    outcome = outcome_of(rates)
    ((label, cells),) = tables(outcome, {"N = 300, as here": outcome})["conditions"].rows
    assert label == "N = 300, as here"
    values = [cell.measured.value for cell in cells]
    np.testing.assert_allclose(values, [100 / 7, 100, -100 / 7, 0, 0, 100])


def test_gaps_are_free_of_the_luck_of_selection():
    rng = np.random.default_rng(0)
    alike = np.subtract(*best_and_worst(rng.normal(size=(4000, 7, 1))))[:, 0]
    assert alike.shape == (2000,)
    assert abs(alike.mean()) < 3.3 * np.sqrt(2 / 2000)
    apart = np.subtract(*best_and_worst(np.arange(7) + rng.normal(size=(200, 7))))
    assert abs(apart.mean() - 6) < 3.3 * np.sqrt(2 / 100)


# Other endings of a frame

ONE = jnp.ones((3, 1, 1))
FRAME = jnp.array([[0.5], [-1.0], [2.0]])
#: Two components that end with other partitions.
TRACKER = jaxpf.Partitioned(
    dynamics=LinearGaussian(transition=ONE, noise=ONE),
    likelihood=Gaussian(noise=ONE),
    ordering=jaxpf.ordering.dps(orders=[[0, 1, 2], [2, 0, 1]]),
    initial=jnp.zeros((3, 1)),
    num_particles=200,
)
KEY = jax.random.key(3)


@functools.cache
def start():
    """The state before the frame, and the library's after it."""
    state = jax.jit(TRACKER.init)(jax.random.key(0))
    return state, jax.jit(TRACKER.step)(jax.random.split(KEY)[0], state, FRAME)[0]


def ended(**how):
    """The library's state after a frame, the other one's, and its summary."""
    state, here = start()
    tracker = OtherEnding(TRACKER, **how)
    return here, *jax.jit(tracker.step)(KEY, state, FRAME)


@pytest.mark.slow
def test_all_partitions_but_the_last_of_the_order_count_twice():
    here, there, summary = ended(counts_twice=True)
    values = np.asarray(here.substates)[..., 0]  # [N, P]
    scores = -((values - np.asarray(FRAME)[:, 0]) ** 2) / 2
    last = np.array([2, 1])[np.asarray(here.component)]
    assert set(last) == {1, 2}
    expected = np.asarray(here.log_weights) + scores.sum(axis=1)
    expected -= scores[np.arange(200), last]
    expected -= np.logaddexp.reduce(expected)
    np.testing.assert_allclose(there.log_weights, expected, rtol=1e-4, atol=1e-4)
    mean = np.exp(expected) @ values
    np.testing.assert_allclose(summary.estimate[:, 0], mean, rtol=1e-4, atol=1e-4)


@pytest.mark.slow
def test_drawing_again_leaves_equal_weights_and_copies():
    here, there, early = ended(draws_again=True)
    np.testing.assert_allclose(np.exp(there.log_weights), 1 / 200, rtol=1e-5)
    assert {tuple(x) for x in np.asarray(there.lineage).T} < {
        tuple(x) for x in np.asarray(here.lineage).T
    }
    _, _, late = ended(draws_again=True, reads_late=True)
    drawn = np.asarray(there.substates)[..., 0]
    np.testing.assert_allclose(late.estimate[:, 0], drawn.mean(axis=0), rtol=1e-4)
    apart = np.asarray(late.estimate - early.estimate)[:, 0]
    assert np.all(apart != 0)
    assert np.all(np.abs(apart) < 4.5 * drawn.std(axis=0) / np.sqrt(200))


# Runs

SMALL = {"num_frames": 9, "frame_width": 180, "frame_height": 160, "num_objects": 3}


@pytest.mark.slow
def test_the_grid_gives_what_single_runs_give():
    """Same keys, same estimates as ``jaxpf.run``, whatever shares the grid's kernel with a run."""
    scene, orderings = drawn.make("distracter", seed=0, **SMALL), scenes.all_orderings(3)
    keys, sharpness = run_keys(0, 0, 2), (20.0, 50.0)
    grid = scenes.grid(scene_tracker(scene, num_particles=40), orderings, sharpness)
    found = jaxpf.monte_carlo(grid, keys, scene.frames[1:])
    assert found.estimate.shape == (2, 8, len(orderings), 2, 3, 3)
    compiled = jax.jit(jaxpf.run)
    for row, name in enumerate(orderings):
        for column, value in enumerate(sharpness):
            tracker = scene_tracker(scene, orderings[name], num_particles=40)
            likelihood = dataclasses.replace(tracker.likelihood, sharpness=value)
            tracker = dataclasses.replace(tracker, likelihood=likelihood)
            _, alone = compiled(tracker, keys[1], scene.frames[1:])
            there = jax.tree.map(lambda x: x[1, :, row, column], found)  # noqa: B023
            np.testing.assert_allclose(there.estimate, alone.estimate, atol=0.05, err_msg=name)
            np.testing.assert_allclose(there.distinct_share, alone.distinct_share, atol=0.051)


def measured_small(seeds, measurements=UNSTORED):
    return scenes.measure(seeds, SMALL, scenes.all_orderings(3), (20.0, 50.0), 40, measurements)


@pytest.mark.slow
def test_another_process_gives_the_same_bits(tmp_path):
    here = measured_small([0, 1])
    with keeping(tmp_path, {}, pool=local_pool(1, jax.local_device_count())) as measurements:
        np.testing.assert_equal(measured_small([0, 1], measurements)[1:], here[1:])


@pytest.mark.slow
def test_measures_of_a_scene_are_those_of_metrics():
    scene, orderings = drawn.make("distracter", seed=0, **SMALL), scenes.all_orderings(3)
    grid = scenes.grid(scene_tracker(scene, num_particles=40), orderings, (20.0, 50.0))
    found = jaxpf.monte_carlo(grid, run_keys(0, 0, 1), scene.frames[1:])
    boxes = boxes_from_substates(found.estimate[:, :, 2, 1], scene.sizes)
    summary = measures.summarise(boxes, scene.boxes[1:])
    outcome = measured_small([0])
    measured = Outcome(outcome.names, *(column[0] for column in outcome[1:]))
    assert measured.recovered[2, 1] == summary["recovery_rate"].value[0]
    np.testing.assert_allclose(measured.success[2, 1], summary["success_rate"].value[1:].mean())
    np.testing.assert_allclose(
        measured.precision[2, 1], summary["precision_all"].value[1:].mean(), rtol=1e-5
    )
    np.testing.assert_allclose(measured.leader_recall[2, 1], summary["recall"].value[0], rtol=1e-5)


@pytest.mark.slow
def test_the_command_prints_and_writes_the_comparison(tmp_path):
    result = program("reproduce", "smith2004", "--scenes", "2", "--quick", "-o", str(tmp_path))
    for words in (
        "Table 1, objects 2-7: success",
        "Table 2, object 1: recovery",
        "a preview, too few",
    ):
        assert words in result.out
    written = {path.name for path in tmp_path.iterdir()}
    assert {"figure_4.png", "verdicts.csv", "run.toml", "smith2004.md"} <= written
    rows = list(csv.DictReader((tmp_path / "table_1_precision.csv").open(newline="")))
    assert len(rows) == 4 * 5
    by_method = {row["column"]: float(row["measured"]) for row in rows if row["row"] == "20"}
    # One scene is enough for what does not depend on it: PS follows closer than the plain filter.
    assert by_method["PS"] > by_method["Non-PS"] + 5
    assert rows[0]["published"] == "69"
