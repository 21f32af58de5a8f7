"""The runs of smith2004: measured as single runs are, and told by the command."""

import csv
import dataclasses

import jax
import numpy as np
import pytest
from command_line import jaxpf

import scenes
from jaxpf import measures, running
from jaxpf.evaluation import local_pool
from jaxpf.evaluation.worker import run_keys
from jaxpf.papers.checkpoints import keeping
from jaxpf.papers.smith2004 import scenes as synthetic
from jaxpf.papers.smith2004.scenes import Outcome, scene_tracker
from jaxpf.shapes import boxes_from_substates

SMALL = {"num_frames": 9, "frame_width": 180, "frame_height": 160, "num_objects": 3}


@pytest.mark.slow
def test_the_grid_gives_what_single_runs_give():
    """Same keys, same estimates as ``jaxpf.run``, whatever shares the grid's kernel with a run."""
    scene, orderings = scenes.make("distracter", seed=0, **SMALL), synthetic.all_orderings(3)
    keys, sharpness = run_keys(0, 0, 2), (20.0, 50.0)
    grid = synthetic.grid(scene_tracker(scene, num_particles=40), orderings, sharpness)
    found = running.monte_carlo(grid, keys, scene.frames[1:])
    assert found.estimate.shape == (2, 8, len(orderings), 2, 3, 3)
    compiled = jax.jit(running.run)
    for row, name in enumerate(orderings):
        for column, value in enumerate(sharpness):
            tracker = scene_tracker(scene, orderings[name], num_particles=40)
            likelihood = dataclasses.replace(tracker.likelihood, sharpness=value)
            tracker = dataclasses.replace(tracker, likelihood=likelihood)
            _, alone = compiled(tracker, keys[1], scene.frames[1:])
            there = jax.tree.map(lambda x: x[1, :, row, column], found)  # noqa: B023
            np.testing.assert_allclose(there.estimate, alone.estimate, atol=0.05, err_msg=name)
            np.testing.assert_allclose(there.distinct_share, alone.distinct_share, atol=0.051)


def measured_small(seeds):
    return synthetic.measure(seeds, SMALL, synthetic.all_orderings(3), (20.0, 50.0), 40)


@pytest.mark.slow
def test_another_process_gives_the_same_bits(tmp_path):
    here = measured_small([0, 1])
    with keeping(tmp_path, {}, local_pool(1, jax.local_device_count())):
        np.testing.assert_equal(measured_small([0, 1])[1:], here[1:])


@pytest.mark.slow
def test_measures_of_a_scene_are_those_of_metrics():
    scene, orderings = scenes.make("distracter", seed=0, **SMALL), synthetic.all_orderings(3)
    grid = synthetic.grid(scene_tracker(scene, num_particles=40), orderings, (20.0, 50.0))
    found = running.monte_carlo(grid, run_keys(0, 0, 1), scene.frames[1:])
    boxes = boxes_from_substates(found.estimate[:, :, 2, 1], scene.sizes)
    summary = measures.summarise(boxes, scene.boxes[1:])
    outcome = measured_small([0])
    measured = Outcome(outcome.names, *(column[0] for column in outcome[1:]))
    assert measured.recovered[2, 1].mean() == summary["recovery_rate"].value[0]
    np.testing.assert_allclose(measured.success[2, 1], summary["success_rate"].value[1:].mean())
    np.testing.assert_allclose(
        measured.precision[2, 1], summary["precision_all"].value[1:].mean(), rtol=1e-5
    )
    np.testing.assert_allclose(measured.leader_recall[2, 1], summary["recall"].value[0], rtol=1e-5)


@pytest.mark.slow
def test_the_command_prints_and_writes_the_comparison(tmp_path):
    result = jaxpf("reproduce", "smith2004", "--scenes", "2", "--quick", "-o", str(tmp_path))
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
