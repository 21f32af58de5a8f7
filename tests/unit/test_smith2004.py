"""The reproduction of smith2004: its published data, its statistics, and its runs."""

import csv
import dataclasses
import json
import re

import cv2
import jax
import numpy as np
import pytest

import scenes
from jaxpf import running
from jaxpf.errors import InputError
from jaxpf.experiments.claims import CANNOT_RESOLVE, CONTRADICTS, SUPPORTS
from jaxpf.experiments.comparison import scene_tracker
from jaxpf.experiments.grid import run_grid, run_keys
from jaxpf.experiments.smith2004 import calibration, judgements, occlusions, run, synthetic, tables
from jaxpf.experiments.smith2004.published import (
    REAL,
    SHARPNESS,
    TABLE_1,
    TABLE_2,
)
from jaxpf.experiments.smith2004.synthetic import NUM_OBJECTS, Outcome
from jaxpf.measures import metrics
from jaxpf.models.geometry import boxes_from_substates
from jaxpf.models.likelihoods.histogram import histogram_from_patches

# --- Published figures ---------------------------------------------------------------------

# A second transcription, in the order in which one reads the paper's rows.
ROWS_1 = """97,69/69 100,90/87 100,91/86
            97,69/68 100,91/87 100,90/86
            93,68/68 100,91/88 100,90/87
            96,67/66 100,91/88 100,90/87"""
ROWS_2 = """2|19|10|42 27/28|27/26|17/16|41/36
            2|18|8|34  21/21|24/24|16/16|36/36
            0|21|16|38 23/22|30/29|18/17|21/22
            2|21|12|36 24/23|28/28|25/24|23/23"""
ROWS_3_4 = """RealSeq1 32/78/59/98 18/18/60/98 40/96/58/98 34/52/62/99 100/100/62/100
              RealSeq2 10/32/72/86 0/8/55/91 12/40/72/86 0/8/59/91 78/88/58/98
              RealSeq3 4/8/41/70 26/28/46/77 82/86/52/87 84/88/51/87 70/72/51/86 36/38/51/79"""


def numbers(text):
    return [float(number) for number in re.findall(r"\d+", text)]


def test_table_1_is_the_papers():
    for row, line in enumerate(ROWS_1.splitlines()):
        assert numbers(line) == [
            TABLE_1[measure][method][row]
            for method in ("Non-PS", "PS", "DPS")
            for measure in ("success", "precision", "recall")
        ]


def test_table_2_is_the_papers():
    methods = ("Non-PS", "PS mean", "PS worst", "DPS")
    for row, line in enumerate(ROWS_2.splitlines()):
        assert numbers(line) == [TABLE_2["recovery"][method][row] for method in methods] + [
            TABLE_2[measure][method][row]
            for method in methods
            for measure in ("precision", "recall")
        ]


def test_tables_3_and_4_are_the_papers():
    for line in ROWS_3_4.splitlines():
        sequence, *cells = line.split()
        assert [list(map(float, cell.split("/"))) for cell in cells] == [
            list(row) for row in REAL[sequence].values()
        ]


def test_the_papers_gains_follow_from_its_tables():
    """Section 3.2: 22 points of precision (20 to 40) and 19.75 of recall (20 to 50)."""
    gain = {
        measure: np.subtract(TABLE_1[measure]["PS"], TABLE_1[measure]["Non-PS"])
        for measure in ("precision", "recall")
    }
    assert gain["precision"][:3].mean() == 22
    assert gain["recall"].mean() == 19.75


# --- Statistics ----------------------------------------------------------------------------


def outcome_of(recovery, runs=synthetic.RUNS_PER_SCENE, scenes_=10, seed=0):
    """An outcome in which the methods recover with given rates, all else alike."""
    names = tuple(synthetic.all_orderings())
    rng = np.random.default_rng(seed)
    shape = (scenes_, len(names), len(SHARPNESS))
    rates = np.array([recovery[name if name in recovery else name.split()[0]] for name in names])
    recovered = rng.uniform(size=(*shape, runs)) < rates[:, None, None]
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
        ess=np.ones(shape),
    )


def claim_on(claims, words):
    (claim,) = [claim for claim in claims if words in claim.statement]
    return claim


def test_verdicts_follow_the_recovery_rates():
    clear = {"Non-PS": 0.02, "PS": 0.2, "DPS": 0.7, "SPS": 0.9}
    claims = judgements.claims(outcome_of(clear, runs=50))
    assert claim_on(claims, "PS, on average").verdict == SUPPORTS
    assert claim_on(claims, "at every sharpness").verdict == SUPPORTS
    reverse = {"Non-PS": 0.7, "PS": 0.4, "DPS": 0.1, "SPS": 0.9}
    claims = judgements.claims(outcome_of(reverse, runs=50))
    assert claim_on(claims, "PS, on average").verdict == CONTRADICTS
    assert claim_on(claims, "at every sharpness").verdict == CONTRADICTS
    same = {"Non-PS": 0.3, "PS": 0.3, "DPS": 0.3, "SPS": 0.3}
    claims = judgements.claims(outcome_of(same))
    assert claim_on(claims, "PS, on average").verdict == CANNOT_RESOLVE
    assert claim_on(claims, "at every sharpness").verdict == CANNOT_RESOLVE


def test_one_scene_resolves_nothing():
    rates = {"Non-PS": 0.0, "PS": 0.5, "DPS": 1.0, "SPS": 1.0}
    claims = judgements.claims(outcome_of(rates, scenes_=1))
    assert {claim.verdict for claim in claims} == {CANNOT_RESOLVE}


def test_orders_that_differ_are_told_from_luck():
    names = [name for name in synthetic.all_orderings() if name.startswith("PS ")]
    base = {"Non-PS": 0.02, "DPS": 0.4, "SPS": 0.7}
    alike = outcome_of({**base, **dict.fromkeys(names, 0.3)})
    differ = outcome_of({**base, **dict(zip(names, np.linspace(0.05, 0.6, 7), strict=True))})
    orders = alike.orders()
    # The worst of seven equal orders looks far below the best ...
    rates = alike.recovered[:, orders, 0].mean(axis=(0, 2))
    assert rates.max() - rates.min() > 0.1
    # ... but no more so than by chance, and not on scenes that had no say in the choice.
    assert tables.order_p_value(alike.recovered[:, orders, 0]) > 0.05
    assert tables.order_p_value(differ.recovered[:, orders, 0]) < 0.01
    assert claim_on(judgements.claims(alike), "worst order").verdict != SUPPORTS
    far = outcome_of({**base, **dict(zip(names, np.linspace(0.02, 0.95, 7), strict=True))})
    assert claim_on(judgements.claims(far), "worst order").verdict == SUPPORTS


@pytest.mark.statistical
def test_p_values_of_equal_orders_are_uniform():
    rng = np.random.default_rng(1)
    values = [tables.order_p_value(rng.uniform(size=(6, 7, 5)) < 0.3) for _ in range(60)]
    assert 0.5 - 4 * np.sqrt(1 / 12 / 60) < np.mean(values) < 0.5 + 4 * np.sqrt(1 / 12 / 60)


def test_worst_and_best_are_those_of_the_recovery_rate():
    names = [name for name in synthetic.all_orderings() if name.startswith("PS ")]
    rates = dict(zip(names, [0.5, 0.5, 0.0, 0.5, 1.0, 0.5, 0.5], strict=True))
    outcome = outcome_of({"Non-PS": 0.0, "DPS": 0.4, "SPS": 0.7, **rates})
    recovery, *_ = tables.table_2(outcome)
    cells = dict(zip(recovery.columns[1:], recovery.rows[0][1], strict=True))
    assert cells["PS worst"].measured.value == 0
    assert cells["PS best"].measured.value == 100
    assert cells["PS worst"].published == 10
    assert cells["PS best"].published is None
    assert recovery.rows[1][1][3].published == 38
    assert cells["SPS"].published is None


def test_uniqueness_is_read_by_stage():
    """Object (shift + stage) stands at that stage of the order that begins with ``shift``."""
    outcome = outcome_of({"Non-PS": 0, "PS": 0.1, "DPS": 0.2, "SPS": 0.3})
    for shift, place in enumerate(outcome.orders()):
        for stage, partition in enumerate(synthetic.shifted(shift)):
            outcome.uniqueness[:, place, 0, partition] = 0.01 * (stage + 1)
    table = tables.uniqueness_table(outcome)
    values = [cell.measured.value for cell in table.rows[0][1]]
    np.testing.assert_allclose(values, np.arange(1, 8))


def test_figures_are_drawn():
    outcome = outcome_of({"Non-PS": 0.02, "PS": 0.2, "DPS": 0.4, "SPS": 0.7})
    assert len(tables.figure_4(outcome).axes) == 15
    assert len(tables.figure_recovery(outcome).axes) == 3


# --- Runs ----------------------------------------------------------------------------------

SMALL = {"num_frames": 9, "frame_width": 180, "frame_height": 160, "num_objects": 3}


@pytest.fixture(scope="module")
def small_grid():
    drawn = [scenes.make("distracter", seed=seed, **SMALL) for seed in (0, 1)]
    orderings = synthetic.all_orderings(3)
    keys = [run_keys(seed, np.arange(2)) for seed in (0, 1)]
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
def test_measures_of_a_scene_are_those_of_metrics(small_grid):
    drawn, orderings, _, results = small_grid
    truth = drawn[0].boxes[1:]
    measured = Outcome(tuple(orderings), *synthetic._measured(drawn[0], results[0]))
    boxes = results[0].boxes[2, 1]
    summary = metrics.summarise(boxes, truth)
    assert measured.recovered[2, 1].mean() == summary["recovery_rate"].value[0]
    np.testing.assert_allclose(measured.success[2, 1], summary["success_rate"].value[1:].mean())
    np.testing.assert_allclose(
        measured.precision[2, 1], summary["precision_all"].value[1:].mean(), rtol=1e-5
    )
    np.testing.assert_allclose(measured.leader_recall[2, 1], summary["recall"].value[0], rtol=1e-5)


def test_seeds_of_the_calibration_are_out_of_the_commands_reach():
    assert min(calibration.SEEDS) >= 2**20
    assert synthetic.SCENE.keys() <= scenes.default_parameters("distracter").keys()


def test_the_search_takes_the_best_of_each_stage(monkeypatch):
    """Figures that are best at one size, likeness and departure lead the search there."""
    asked = []

    def pretend(seeds, parameters):
        asked.append(parameters)
        far = abs(parameters["object_width"] - 28) / 8
        off = abs(parameters["likeness"] - 0.15) + abs(parameters["lead_distance"] - 26) / 100
        wrong = 0.3 if parameters["departure"] < 50 else 0.0
        names = tuple(synthetic.all_orderings())
        shape = (1, len(names), 4)
        published = {"Non-PS": (0.69, 0.015), "PS": (0.91, 0.2), "DPS": (0.9, 0.375)}
        precision, recovered = np.zeros(shape), np.zeros((*shape, 5))
        for place, name in enumerate(names):
            cells = published.get("PS" if name.startswith("PS ") else name, (0, 0))
            precision[:, place], recovered[:, place] = cells[0] - far / 10, cells[1] + off + wrong
        outcome = outcome_of({"Non-PS": 0, "PS": 0, "DPS": 0, "SPS": 0})
        return outcome._replace(precision=precision, recovered=recovered)

    monkeypatch.setattr(calibration, "measure", pretend)
    lines = []
    best, trials = calibration.search(seeds=[0], report=lines.append)
    assert (best["object_width"], best["likeness"], best["lead_distance"]) == (28, 0.15, 26.0)
    assert best["departure"] == 55.0
    assert len(trials) == len(lines) == len(asked) == 4 + 16 + 3
    table = calibration.trial_table(trials)
    assert {len(cells) for _, cells in table.rows} == {len(table.columns) - 1}


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
    assert [(each.identity, each.hidden, each.runs) for each in outcomes] == [
        (identity, identity in (2, 4), 5) for identity in (1, 2, 3, 4, 5)
    ]
    for_2, for_4, overview = occlusions.tables(outcomes)
    assert ("object 2" in for_2.title, "object 4" in for_4.title) == (True, True)
    assert [label for label, _ in overview.rows] == list(synthetic.all_orderings(5))
    assert len(overview.columns) == 1 + 5
    # Objects that are easy to follow for 8 frames: independent filters lose none of them.
    assert outcomes[0].successes["SPS"] == outcomes[0].recoveries["SPS"] == 5
    assert outcomes[0].precision["SPS"].value > 50


def occluded(identity, particles, recoveries, runs=50):
    names = list(synthetic.all_orderings(5))
    counts = {name: recoveries.get(name, recoveries.get(name.split()[0], 0)) for name in names}
    return occlusions.Tracked(particles, identity, True, runs, counts, counts, {}, {})


def test_conclusions_on_real_occlusions():
    rich = occluded(5, 300, {"DPS": 50, "PS": 20, "PS 1,2,3,4,5": 45, "PS 2,3,4,5,1": 5})
    starved = occluded(5, 60, {"DPS": 5, "PS": 30})
    claims = occlusions.claims([rich, starved])
    assert [claim.verdict for claim in claims] == [SUPPORTS] * 3
    claims = occlusions.claims([starved._replace(particles=300), rich._replace(particles=60)])
    assert [claim.verdict for claim in claims] == [CONTRADICTS, CANNOT_RESOLVE, CONTRADICTS]


def test_runs_must_fill_the_scenes():
    with pytest.raises(InputError, match="multiple of 2"):
        run(runs=7)


@pytest.mark.slow
def test_the_command_prints_and_writes_the_comparison(tmp_path, capsys, monkeypatch):
    from jaxpf.cli import main

    monkeypatch.delenv("JAXPF_DATA", raising=False)
    output = tmp_path / "out"
    main(["reproduce", "smith2004", "--runs", "2", "--quick", "--output", str(output)])
    printed = capsys.readouterr().out
    for words in ("Table 1, objects 2-7: success", "Table 2, object 1: recovery", "Claims"):
        assert words in printed
    assert "cannot resolve" in printed
    assert {"figure_4.png", "recovery.png", "sweep.png", "run.toml", "smith2004.md"} <= {
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
        (["--runs", "7"], "multiple of 2"),
        (["--runs", "0"], "at least 1"),
        (["--seed", "-1"], "--seed -1"),
        (["--data", "nowhere"], "no folder"),
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
