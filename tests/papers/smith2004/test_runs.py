"""The runs of smith2004: measured as single runs are, and told by the command."""

import csv
import dataclasses

import jax
import numpy as np
import pytest

import scenes
from jaxpf import measures, running
from jaxpf.evaluation import local_pool
from jaxpf.evaluation.work.worker import run_keys
from jaxpf.likelihoods import histogram_from_patches
from jaxpf.papers.checkpoints import sharing
from jaxpf.papers.smith2004 import scenes as synthetic
from jaxpf.papers.smith2004.comparison import scene_tracker
from jaxpf.papers.smith2004.grid import run_grid
from jaxpf.papers.smith2004.scenes import Outcome
from jaxpf.shapes import boxes_from_substates

# --- Runs ----------------------------------------------------------------------------------

SMALL = {"num_frames": 9, "frame_width": 180, "frame_height": 160, "num_objects": 3}


@pytest.fixture(scope="module")
def small_grid():
    drawn = [scenes.make("distracter", seed=seed, **SMALL) for seed in (0, 1)]
    orderings = synthetic.all_orderings(3)
    keys = [run_keys(seed, 0, 2) for seed in (0, 1)]
    results = list(run_grid(drawn, keys, orderings, [20.0, 50.0], num_particles=40))
    return drawn, orderings, keys, results


@pytest.mark.slow
def test_the_grid_gives_what_single_runs_give(small_grid):
    """Same keys, same boxes as ``jaxpf.run``, whatever shares the grid's kernel with a run."""
    drawn, orderings, keys, results = small_grid
    compiled = jax.jit(running.run)
    for scene, scene_keys, result in zip(drawn, keys, results, strict=True):
        assert result.boxes.shape == (len(orderings), 2, 2, 8, 3, 4)
        for place, name in enumerate(orderings):
            for column, sharpness in enumerate((20.0, 50.0)):
                # So few particles would be counted by samples; the grid has an integral histogram.
                likelihood = histogram_from_patches(
                    scene.patches, scene.sizes, sharpness=sharpness, method="integral"
                )
                tracker = dataclasses.replace(
                    scene_tracker(scene, orderings[name], num_particles=40), likelihood=likelihood
                )
                _, summary = compiled(tracker, scene_keys[1], scene.frames[1:])
                boxes = boxes_from_substates(summary.estimate, scene.sizes)
                np.testing.assert_allclose(
                    result.boxes[place, column, 1], boxes, atol=0.05, err_msg=name
                )
                np.testing.assert_allclose(
                    result.uniqueness[place, column, 1], summary.uniqueness, atol=0.051
                )


@pytest.mark.slow
def test_another_process_gives_the_same_bits(small_grid):
    drawn, orderings, keys, results = small_grid
    with sharing(local_pool(1, jax.local_device_count())):
        there = run_grid(drawn, keys, orderings, [20.0, 50.0], num_particles=40)
        np.testing.assert_equal(list(there), results)


@pytest.mark.slow
def test_measures_of_a_scene_are_those_of_metrics(small_grid, monkeypatch):
    drawn, orderings, _, results = small_grid
    truth = drawn[0].boxes[1:]
    monkeypatch.setattr(synthetic, "run_grid", lambda *_, **__: results[:1])
    outcome = synthetic.measure([0], SMALL, orderings, [20.0, 50.0])
    measured = Outcome(outcome.names, *(column[0] for column in outcome[1:]))
    boxes = results[0].boxes[2, 1]
    summary = measures.summarise(boxes, truth)
    assert measured.recovered[2, 1].mean() == summary["recovery_rate"].value[0]
    np.testing.assert_allclose(measured.success[2, 1], summary["success_rate"].value[1:].mean())
    np.testing.assert_allclose(
        measured.precision[2, 1], summary["precision_all"].value[1:].mean(), rtol=1e-5
    )
    np.testing.assert_allclose(measured.leader_recall[2, 1], summary["recall"].value[0], rtol=1e-5)


@pytest.mark.slow
def test_the_command_prints_and_writes_the_comparison(tmp_path, capsys):
    from jaxpf.cli import main

    output = tmp_path / "out"
    main(["reproduce", "smith2004", "--scenes", "2", "--quick", "--output", str(output)])
    printed = capsys.readouterr().out
    for words in ("Table 1, objects 2-7: success", "Table 2, object 1: recovery", "of 13 hold"):
        assert words in printed
    assert "hold" in printed
    assert {"figure_4.png", "verdicts.csv", "run.toml", "smith2004.md"} <= {
        path.name for path in output.iterdir()
    }
    with open(output / "table_1_precision.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 4 * 5
    by_method = {row["column"]: float(row["measured"]) for row in rows if row["row"] == "20"}
    # One scene is enough for what does not depend on it: PS follows closer than the plain filter.
    assert by_method["PS"] > by_method["Non-PS"] + 5
    assert rows[0]["published"] == "69"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--scenes", "0"], "--scenes"),
        (["--seed", "-1"], "Invalid value for '--seed': -1 is not in the range 0<=x<=1048575"),
    ],
)
def test_mistakes_are_one_sentence(arguments, words, tmp_path, capsys, monkeypatch):
    from jaxpf.cli import main

    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as exit_:
        main(["reproduce", "smith2004", "--output", "out", *arguments])
    assert exit_.value.code == 2
    assert words in capsys.readouterr().err


def test_a_folder_with_results_is_not_overwritten(tmp_path, capsys):
    from jaxpf.cli import main

    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(SystemExit):
        main(["reproduce", "smith2004", "--output", str(tmp_path)])
    assert "--overwrite" in capsys.readouterr().err
