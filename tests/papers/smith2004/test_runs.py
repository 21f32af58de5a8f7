"""The runs of smith2004: measured as single runs are, and told by the command."""

import csv
import dataclasses
import json

import cv2
import jax
import numpy as np
import pytest

import scenes
from jaxpf import InputError, measures, running
from jaxpf.evaluation import local_pool
from jaxpf.evaluation.work.worker import run_keys
from jaxpf.likelihoods import histogram_from_patches
from jaxpf.papers.checkpoints import sharing
from jaxpf.papers.judging.claims import NOT_SEEN, OPEN, SUPPORTED, judge_all
from jaxpf.papers.smith2004 import occlusions, scenes as synthetic
from jaxpf.papers.smith2004.claims import of_occlusions
from jaxpf.papers.smith2004.comparison import scene_tracker
from jaxpf.papers.smith2004.grid import run_grid
from jaxpf.papers.smith2004.scenes import Outcome
from jaxpf.papers.smith2004.tables import occlusion_tables
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


@pytest.fixture(scope="module")
def clip_folder(tmp_path_factory):
    """A clip like tud_campus, five objects on 9 frames, two of them hidden for a while."""
    data = tmp_path_factory.mktemp("data")
    folder = data / occlusions.CLIP
    (folder / "frames").mkdir(parents=True)
    scene = scenes.make("distracter", seed=0, **{**SMALL, "num_objects": 5, "frame_width": 240})
    for number, frame in enumerate(scene.frames):
        cv2.imwrite(str(folder / "frames" / f"{number:04d}.png"), frame[..., ::-1])
    height, width = scene.frames.shape[1:3]
    meta = {"name": occlusions.CLIP, "frames": "frames/%04d.png", "n_frames": 9, "fps": 25}
    (folder / "meta.json").write_text(json.dumps({**meta, "width": width, "height": height}))
    with open(folder / "gt.csv", "w") as file:
        file.write("frame,id,x,y,w,h,occ\n")
        for frame, boxes in enumerate(scene.boxes):
            for number, box in enumerate(boxes, start=1):
                file.write(f"{frame},{number},{','.join(f'{x:.2f}' for x in box)},0\n")
    (folder / "events.csv").write_text(
        "start,end,occluded_id,occluder_id,max_fraction\n1,3,4,5,1.0\n2,4,2,5,1.0\n2,4,3,5,0.5\n"
    )
    return data


def test_hidden_objects_are_those_fully_occluded(clip_folder):
    assert occlusions.hidden_objects(clip_folder / occlusions.CLIP) == [2, 4]


def test_a_clip_without_its_events_is_told(clip_folder, tmp_path):
    with pytest.raises(InputError, match=r"events\.csv"):
        occlusions.hidden_objects(tmp_path)
    with pytest.raises(InputError, match="holds no tud_campus"):
        occlusions.clip_folder(tmp_path)
    assert occlusions.clip_folder(clip_folder / occlusions.CLIP).name == occlusions.CLIP


@pytest.mark.slow
def test_real_occlusions_are_measured_and_judged(clip_folder):
    """Five runs, whatever the number of devices that share them."""
    outcomes = occlusions.measure(clip_folder, 5, seed=0, particles=(30,))
    assert [(each.identity, each.hidden) for each in outcomes] == [
        (identity, identity in (2, 4)) for identity in (1, 2, 3, 4, 5)
    ]
    for_2, for_4, overview = occlusion_tables(outcomes)
    assert ("object 2" in for_2.title, "object 4" in for_4.title) == (True, True)
    assert [label for label, _ in overview.rows] == list(synthetic.all_orderings(5))
    assert len(overview.columns) == 1 + 5
    # Objects that are easy to follow for 8 frames: independent filters lose none of them.
    assert outcomes[0].success["SPS"].sum() == outcomes[0].recovered["SPS"].sum() == 5
    assert outcomes[0].precision["SPS"].mean() > 50


def occluded(identity, particles, recoveries, runs=50):
    names = list(synthetic.all_orderings(5))
    counts = {name: recoveries.get(name, recoveries.get(name.split()[0], 0)) for name in names}
    # Different methods recover it in different runs.
    recovered = {
        name: np.roll(np.arange(runs) < count, 7 * place)
        for place, (name, count) in enumerate(counts.items())
    }
    return occlusions.Tracked(particles, identity, True, recovered, recovered, {}, {})


def test_conclusions_on_real_occlusions():
    def verdicts(outcomes):
        return [each.verdict for each in judge_all("smith2004", of_occlusions(outcomes))]

    rich = occluded(5, 300, {"DPS": 50, "PS": 20, "PS 1,2,3,4,5": 38, "PS 2,3,4,5,1": 5})
    starved = occluded(5, 60, {"DPS": 5, "PS": 30})
    assert verdicts([rich, starved]) == [*[SUPPORTED] * 4, NOT_SEEN]
    swapped = [starved._replace(particles=300), rich._replace(particles=60)]
    assert verdicts(swapped) == [NOT_SEEN, OPEN, NOT_SEEN, NOT_SEEN, SUPPORTED]
    assert of_occlusions([]) == {}


@pytest.mark.slow
def test_the_command_prints_and_writes_the_comparison(tmp_path, capsys, monkeypatch):
    from jaxpf.cli import main

    monkeypatch.delenv("JAXPF_DATA", raising=False)
    output = tmp_path / "out"
    main(["reproduce", "smith2004", "--scenes", "2", "--quick", "--output", str(output)])
    printed = capsys.readouterr().out
    for words in ("Table 1, objects 2-7: success", "Table 2, object 1: recovery", "of 14 hold"):
        assert words in printed
    assert "hold" in printed
    assert {"figure_4.png", "recovery.png", "verdicts.csv", "run.toml", "smith2004.md"} <= {
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
        (["--seed", "-1"], "--seed -1"),
        (["--data", "nowhere"], "not a folder"),
        (["--data", "."], "holds no tud_campus"),
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
