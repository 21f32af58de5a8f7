"""``jaxpf evaluate``: what it writes, that it continues, and what it says to a mistake."""

import csv
import os
import subprocess
import sys
import tomllib

import numpy as np
import pytest
from command_line import jaxpf
from small_evaluation import COMMON, PARAMETERS, PARTICLES
from small_sequence_folder import SMALL

from jaxpf.evaluation import Results

pytestmark = pytest.mark.usefixtures("started_jax")
WRITTEN = ["report.html", "results.csv", "summary.csv", "summary.md", "run.toml"]


@pytest.fixture(scope="module")
def whole(place):
    """One evaluation of a synthetic scene: its outcome and its folder."""
    output = place / "whole"
    outcome = jaxpf("evaluate", "distracter", *SMALL, *COMMON, "-o", output)
    assert outcome.code == 0, outcome.err
    return outcome, output


def test_it_shows_the_plan_first_then_the_tables_and_writes_everything(whole):
    outcome, output = whole
    plan, tables = outcome.out.index("Plan"), outcome.out.index("all objects")
    assert plan < tables
    assert "distracter: 2 objects, 9 frames after the start frame 0, 40 x 30" in outcome.out
    assert "12 runs to do, with " in outcome.out
    assert f"particles {PARTICLES}" in outcome.out
    for name in WRITTEN:
        assert (output / name).stat().st_size > 0, name
        assert name in outcome.out
    with open(output / "results.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 3 * 4 * 2  # configurations, runs, objects
    assert {row["ordering"] for row in rows if row["method"] == "PS"} == {"12", "21"}
    assert "left 0:00:00" in outcome.err  # the progress bar
    assert "12/12" in outcome.err


def test_a_second_call_prints_the_same_and_does_nothing(whole):
    first, output = whole
    before = {path: path.stat().st_mtime_ns for path in output.rglob("*")}
    again = jaxpf("evaluate", "distracter", *SMALL, *COMMON, "-o", output)
    assert again.code == 0
    assert again.out == first.out[first.out.index("all objects") :]
    assert {path: path.stat().st_mtime_ns for path in output.rglob("*")} == before
    dry = jaxpf("evaluate", "distracter", *SMALL, *COMMON, "-o", output, "--dry-run")
    assert dry.out == f"{output}/: finished, nothing left to do\n"


def test_a_second_call_does_not_need_jax(whole):
    _, output = whole
    arguments = list(map(str, ["evaluate", "distracter", *SMALL, *COMMON, "-o", output]))
    code = (
        f"import sys; from jaxpf import cli; cli.main({arguments!r}); print('jax' in sys.modules)"
    )
    ran = subprocess.run(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, text=True, check=True
    )
    assert ran.stdout.splitlines()[-1] == "False"


def test_a_report_that_is_missing_is_written_again_without_running(whole, short_report):
    _, output = whole
    batches = {path: path.stat().st_mtime_ns for path in (output / "batches").iterdir()}
    (output / "summary.md").unlink()
    again = jaxpf("evaluate", "distracter", *SMALL, *COMMON, "-o", output)
    assert again.code == 0
    assert "Plan" not in again.out
    assert (output / "summary.md").exists()
    assert {path: path.stat().st_mtime_ns for path in (output / "batches").iterdir()} == batches


def test_run_toml_repeats_the_evaluation(whole, tmp_path, short_report):
    _, output = whole
    options = tomllib.loads((output / "run.toml").read_text())["evaluate"]
    assert options["scene"] == "distracter"
    assert options["methods"] == "sir,ps"
    assert options["scale"] == [[1.0, 1.0, 0.001]]
    assert "output" not in options
    again = jaxpf("evaluate", "--config", output / "run.toml", "-o", tmp_path / "again")
    assert again.code == 0, again.err
    first, second = Results.open(output), Results.open(tmp_path / "again")
    for one, other in zip(first.configurations, second.configurations, strict=True):
        (left,), (right,) = first.batches(one), second.batches(other)
        np.testing.assert_array_equal(left.shapes, right.shapes)
    assert (output / "run.toml").read_text() == (tmp_path / "again" / "run.toml").read_text()


def test_more_runs_continue_and_the_report_follows(whole, short_report):
    _, output = whole
    # As many as before: blocks of one width, one compiled kernel.
    more = jaxpf("evaluate", "distracter", *SMALL, *COMMON, "--runs", "8", "-o", output)
    assert more.code == 0, more.err
    assert "12 runs to do" in more.out
    assert [Results.open(output).finished(c) for c in Results.open(output).configurations] == [
        8
    ] * 3
    with open(output / "results.csv", newline="") as file:
        assert len(list(csv.DictReader(file))) == 3 * 8 * 2
    fewer = jaxpf("evaluate", "distracter", *SMALL, *COMMON, "-o", output)
    assert fewer.code == 2
    assert "was begun with runs = 8, now 4" in fewer.err


def test_a_recorded_sequence_with_another_trackers_results(
    place, tmp_path, monkeypatch, short_report
):
    monkeypatch.chdir(place)
    outcome = jaxpf(
        *("evaluate", "two", *COMMON, "--methods", "ps", "--orders", "2,1", "--ids", "3,7"),
        *("--tracks", "theirs=theirs.csv", "-o", tmp_path / "out"),
    )
    assert outcome.code == 0, outcome.err
    results = Results.open(tmp_path / "out")
    assert results.object_ids == (3, 7)
    assert [c.label for c in results.configurations] == ["PS 12", "PS 21", "theirs"]
    (batch,) = results.batches(results.configurations[-1])
    np.testing.assert_allclose(batch.shapes[0], results.truth, rtol=1e-6)
    options = tomllib.loads((tmp_path / "out" / "run.toml").read_text())["evaluate"]
    assert options["scene"] == str((place / "two").resolve())
    assert options["tracks"] == [f"theirs={(place / 'theirs.csv').resolve()}"]


def test_baselines_stand_in_the_same_tables(place, tmp_path, short_report):
    more = ("--baseline", "still,meanshift", "--baseline", "still", "-o", tmp_path / "out")
    outcome = jaxpf("evaluate", place / "two", *COMMON, "--speed", *more)
    assert outcome.code == 0, outcome.err
    assert "Baselines come first: still, meanshift" in outcome.err
    assert "still: one track, the same for every seed" in outcome.out
    results = Results.open(tmp_path / "out")
    assert [c.label for c in results.configurations][-2:] == ["still", "meanshift"]
    (still,) = results.batches(results.configurations[-2])
    np.testing.assert_array_equal(still.shapes[0, 0], still.shapes[0, -1])
    # One run of a method is timed, which two orders of PS share; meanshift on its way, and
    # `still` not at all: it does no work.
    assert outcome.err.count("Timing one run alone: ") == 2
    assert "frames/s" in outcome.out[outcome.out.index("all objects") :]
    with open(tmp_path / "out" / "summary.csv", newline="") as file:
        speeds = [r for r in csv.DictReader(file) if r["measure"] == "frames_per_second"]
    assert [row["method"] for row in speeds] == ["SIR", "PS", "PS", "meanshift"]
    assert all(float(row["value"]) > 1 for row in speeds)
    assert speeds[1]["value"] == speeds[2]["value"]
    again = jaxpf("evaluate", "--config", tmp_path / "out" / "run.toml", place / "two", *more[-2:])
    assert again.code == 0, again.err
    assert again.out in outcome.out


@pytest.mark.slow
def test_of_one_object_one_method_is_run_and_the_output_says_why(place, tmp_path, short_report):
    arguments = ("evaluate", place / "two", "--ids", "7", "--runs", "4", *COMMON[4:8])
    outcome = jaxpf(*arguments, "-o", tmp_path / "out")
    assert outcome.code == 0, outcome.err
    assert "all orderings coincide" in outcome.out
    (one,) = Results.open(tmp_path / "out").configurations
    assert one.method == "SIR"
    every = (*arguments, "--methods", "sir,ps,dps,sps", "-o", tmp_path / "every")
    assert jaxpf(*every).code == 0
    results = Results.open(tmp_path / "every")
    first, *others = (next(results.batches(c)).shapes for c in results.configurations)
    assert len(others) == 3
    for shapes in others:
        np.testing.assert_array_equal(shapes, first)


def test_a_users_function_makes_a_scene(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.py").write_text(
        "import scenes\n"
        "def small(seed, num_frames):\n"
        f"    parameters = {PARAMETERS} | {{'num_frames': num_frames}}\n"
        "    return scenes.make('distracter', seed=seed, **parameters)\n"
    )
    outcome = jaxpf(*("evaluate", "mine.py:small", "--set", "num_frames=10", *COMMON, "--dry-run"))
    assert outcome.code == 0, outcome.err
    assert "distracter: 2 objects, 9 frames" in outcome.out
    assert sorted(os.listdir(tmp_path)) in (["mine.py"], ["__pycache__", "mine.py"])


def test_a_dry_run_shows_the_plan_of_a_grid_and_writes_nothing(place, tmp_path):
    outcome = jaxpf(
        *("evaluate", "distracter", *SMALL, "-n", "100,200", "--sharpness", "20,30", "--runs", "9"),
        *("--tracks", f"theirs={place / 'theirs.csv'}", "-o", tmp_path / "out", "--dry-run"),
    )
    assert outcome.code == 0, outcome.err
    table = {line.split()[1]: line for line in outcome.out.splitlines() if line.startswith("│")}
    assert "4 x 9" in table["PS"]
    assert "4 x 9" in table["DPS"]
    assert "1 x 1" in table["theirs"]
    assert "20 30" in table["SIR"]
    assert f"{9 * (4 + 4 + 4 + 4) + 1} runs to do" in outcome.out
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("scene", "note"),
    [
        (
            "two",
            "Note: --sharpness sets --appearance colour, which reports no confidence; the default "
            "is discriminative.\n",
        ),
        ("distracter", ""),
    ],
)
def test_options_that_change_others_say_so_in_one_line(place, tmp_path, monkeypatch, scene, note):
    monkeypatch.chdir(place)
    options = [*(SMALL if scene == "distracter" else []), "--sharpness", "5", *COMMON[:6]]
    outcome = jaxpf("evaluate", scene, *options, "--dry-run", "-o", tmp_path / "out")
    assert outcome.code == 0, outcome.err
    assert "".join(line for line in outcome.err.splitlines(True) if "Note" in line) == note


def test_methods_with_numbers_of_particles_of_their_own_are_planned(tmp_path):
    """Where nobody says how many, a factored filter has another default, which is no option's."""
    outcome = jaxpf(
        *("evaluate", "distracter", *SMALL, "--methods", "eskil,pffl", "--runs", "2"),
        *("-o", tmp_path / "out", "--dry-run"),
    )
    assert outcome.code == 0, outcome.err
    assert "4 runs to do" in outcome.out


def test_a_tracker_that_its_file_has_not_is_refused_before_settings_are_compared(whole, tmp_path):
    _, output = whole
    (tmp_path / "tr.py").write_text("def present(scene):\n    return None\n")
    for name, said in (("missing", "has no function 'missing'"), ("present", "'present' is new")):
        own = ("--tracker", f"{tmp_path / 'tr.py'}:{name}", "-o", output)
        outcome = jaxpf("evaluate", "distracter", *SMALL, *COMMON, *own)
        assert outcome.code == 2
        assert said in outcome.err


def test_help_of_a_scene_explains_the_options_of_its_objects():
    shown = jaxpf("evaluate", "articulated", "--help").out
    assert "Noise of a joint" in shown or "noise of a joint" in shown
    assert "--window-size" not in shown
    assert "--window-size" in jaxpf("evaluate", "--help-all").out


def test_help_of_methods_explains_their_options_alone():
    shown = jaxpf("evaluate", "distracter", "--methods", "sir,ps", "--help-all").out
    assert "--ess-threshold" in shown
    assert "--resampling" in shown
    assert "--drift" not in shown
    assert "--scope" not in shown
    assert "--drift" in jaxpf("tune", "distracter", "--method", "eskil", "--help-all").out


@pytest.mark.parametrize("command", ["evaluate", "tune"])
def test_help_fits_on_a_screen(command, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    assert len(jaxpf(command, "--help").out.splitlines()) <= 60


def test_changed_settings_are_refused_with_the_difference(whole):
    _, output = whole
    outcome = jaxpf("evaluate", "distracter", *SMALL, *COMMON, "--seed", "9", "-o", output)
    assert outcome.code == 2
    assert outcome.out == ""
    assert f"the evaluation in '{output}' was begun with seed = 0, now 9" in outcome.err


@pytest.mark.slow
def test_the_console_script_works_with_worker_processes(whole, tmp_path):
    """As a user would: a program of its own, two processes of one device each."""
    arguments = ["distracter", *SMALL, *COMMON, "--runs", "6", "--workers", "2"]
    command = [sys.executable, "-m", "jaxpf", "evaluate", *map(str, arguments)]
    ran = subprocess.run([*command, "-o", tmp_path / "out"], capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr
    assert "in each of 2 processes on 1 device" in ran.stdout
    alone, shared = Results.open(whole[1]), Results.open(tmp_path / "out")
    for configuration in shared.configurations:
        left, right = (
            np.concatenate([batch.shapes for batch in results.batches(configuration)])
            for results in (alone, shared)
        )
        np.testing.assert_array_equal(left[:4], right[:4])
