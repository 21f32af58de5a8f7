"""``jaxpf evaluate``: what it writes, that it continues, and what it says to a mistake."""

import subprocess
import sys
import tomllib

import numpy as np
import pytest
from command_line import jaxpf, refusal_of
from csv_rows import rows_of
from small_evaluation import COMMON, PARAMETERS, PARTICLES, assert_equal_bits, content
from small_sequence_folder import SMALL

from jaxpf.evaluation import Results

pytestmark = pytest.mark.usefixtures("started_jax")
WRITTEN = ["report.html", "results.csv", "summary.csv", "curves.csv", "run.toml"]
SCENE = ("distracter", *SMALL)


def stamps(folder):
    files = [path for path in folder.rglob("*") if path.name != ".lock"]
    return {path: path.stat().st_mtime_ns for path in files}


def evaluated(*arguments):
    """Evaluate with success."""
    outcome = jaxpf("evaluate", *arguments)
    assert outcome.code == 0, outcome.err
    return outcome


@pytest.fixture(scope="module")
def whole(place):
    """One evaluation of a synthetic scene: its outcome and its folder."""
    output = place / "whole"
    return evaluated(*SCENE, *COMMON, "-o", output), output


def test_it_shows_the_plan_first_then_the_tables_and_writes_everything(whole):
    outcome, output = whole
    plan, tables = outcome.out.index("Plan"), outcome.out.index("all objects")
    assert plan < tables
    assert "distracter: 2 objects, 9 frames after the start frame 0, 40 x 30" in outcome.out
    assert "12 runs to do on " in outcome.out
    assert f"num_particles {PARTICLES}" in outcome.out
    for name in WRITTEN:
        assert (output / name).stat().st_size > 0, name
        assert name in outcome.out
    rows = rows_of(output / "results.csv")
    assert len(rows) == 3 * 4 * 2  # configurations, runs, objects
    assert {row["ordering"] for row in rows if row["method"] == "PS"} == {"12", "21"}
    assert "left 0:00:00" in outcome.err  # the progress bar
    assert "12/12" in outcome.err


def test_a_second_call_runs_nothing_and_prints_the_same(whole, short_report):
    first, output = whole
    before = stamps(output / "batches")
    (output / "summary.csv").unlink()
    again = evaluated(*SCENE, *COMMON, "-o", output)
    assert again.out == first.out[first.out.index("all objects") :]
    assert (output / "summary.csv").exists()
    assert stamps(output / "batches") == before
    dry = jaxpf("evaluate", *SCENE, *COMMON, "-o", output, "--dry-run")
    assert dry.out == f"{output}/: finished, nothing left to do\n"


def test_run_toml_repeats_the_evaluation(whole, tmp_path, short_report):
    _, output = whole
    options = tomllib.loads((output / "run.toml").read_text())["evaluate"]
    assert (options["scene"], options["methods"]) == ("distracter", "sir,ps")
    assert options["noise_pixels"] == [[1.0, 1.0, 0.001]]
    assert "output" not in options
    evaluated("--config", output / "run.toml", "-o", tmp_path / "again")
    assert_equal_bits(content(Results.open(tmp_path / "again")), content(Results.open(output)))
    assert (output / "run.toml").read_text() == (tmp_path / "again" / "run.toml").read_text()


@pytest.mark.slow
def test_a_recorded_sequence_with_another_trackers_results(
    place, tmp_path, monkeypatch, short_report
):
    monkeypatch.chdir(place)
    chosen = ("--methods", "ps", "--orders", "2,1", "--ids", "3,7", "--appearance", "colour")
    evaluated("two", *COMMON, *chosen, "--tracks", "theirs=theirs.csv", "-o", tmp_path / "out")
    results = Results.open(tmp_path / "out")
    assert results.object_ids == (3, 7)
    assert [c.label for c in results.configurations] == ["PS 12", "PS 21", "theirs"]
    (batch,) = results.batches(results.configurations[-1])
    np.testing.assert_allclose(batch.shapes[0], results.truth, rtol=1e-6)
    options = tomllib.loads((tmp_path / "out" / "run.toml").read_text())["evaluate"]
    assert options["scene"] == str((place / "two").resolve())
    assert options["tracks"] == [f"theirs={(place / 'theirs.csv').resolve()}"]


@pytest.mark.slow
def test_baselines_stand_in_the_same_tables(place, tmp_path, short_report):
    output = tmp_path / "out"
    more = ("--baseline", "still,meanshift", "--baseline", "still", "-o", output)
    outcome = evaluated(place / "two", *COMMON, "--speed", *more)
    assert "Baselines come first: still, meanshift" in outcome.err
    assert "still: one track, the same for every seed" in outcome.out
    results = Results.open(output)
    assert [c.label for c in results.configurations][-2:] == ["still", "meanshift"]
    (still,) = results.batches(results.configurations[-2])
    np.testing.assert_array_equal(still.shapes[0, 0], still.shapes[0, -1])
    # One run of a method is timed, which two orders of PS share; meanshift on its way, and
    # `still` not at all: it does no work.
    assert outcome.err.count("Timing one run alone: ") == 2
    assert "frames/s" in outcome.out[outcome.out.index("all objects") :]
    speeds = [r for r in rows_of(output / "summary.csv") if r["measure"] == "frames_per_second"]
    assert [row["method"] for row in speeds] == ["SIR", "PS", "PS", "meanshift"]
    assert all(float(row["value"]) > 1 for row in speeds)
    assert speeds[1]["value"] == speeds[2]["value"]
    again = evaluated("--config", output / "run.toml", place / "two", *more[-2:])
    assert again.out in outcome.out


@pytest.mark.slow
def test_of_one_object_one_method_is_run_and_the_output_says_why(place, tmp_path, short_report):
    arguments = (place / "two", "--ids", "7", "--runs", "4", *COMMON[4:8])
    outcome = evaluated(*arguments, "-o", tmp_path / "out")
    assert "all orderings coincide" in outcome.out
    (one,) = Results.open(tmp_path / "out").configurations
    assert one.method == "SIR"
    evaluated(*arguments, "--methods", "sir,ps,dps,sps", "-o", tmp_path / "every")
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
    outcome = evaluated("mine.py:small", "--set", "num_frames=10", *COMMON, "--dry-run")
    assert "distracter: 2 objects, 9 frames" in outcome.out
    assert {path.name for path in tmp_path.iterdir()} <= {"mine.py", "__pycache__"}


def test_a_dry_run_shows_the_plan_of_a_grid_and_writes_nothing(place, tmp_path):
    grid = ("-n", "100,200", "--sharpness", "20,30", "--runs", "9")
    more = ("--tracks", f"theirs={place / 'theirs.csv'}", "-o", tmp_path / "out", "--dry-run")
    outcome = evaluated(*SCENE, *grid, *more)
    table = {line.split()[1]: line for line in outcome.out.splitlines() if line.startswith("│")}
    assert "4 x 9" in table["PS"]
    assert "4 x 9" in table["DPS"]
    assert "1 x 1" in table["theirs"]
    assert "20 30" in table["SIR"]
    assert f"{9 * (4 + 4 + 4 + 4) + 1} runs to do" in outcome.out
    # Where nobody says how many, a factored filter has another default, which is no option's.
    own = ("--methods", "eskil,pffl", "--runs", "2", *more[2:])
    assert "4 runs to do" in evaluated(*SCENE, *own).out
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("options", "named"),
    [
        ("--tracker {}:missing", "'missing'"),  # before settings are compared
        ("--tracker {}:present", "present = nothing, now"),
    ],
)
def test_other_settings_are_refused_with_the_difference(whole, tmp_path, options, named):
    path, (_, output) = tmp_path / "tr.py", whole
    path.write_text("def present(scene):\n    return None\n")
    words = options.format(path).split()
    assert named in refusal_of("evaluate", *SCENE, *COMMON, *words, "-o", output)


@pytest.mark.slow
def test_the_console_script_works_with_worker_processes(whole, tmp_path):
    """As a user would: a program of its own, two processes of one device each."""
    arguments = [*SCENE, *COMMON, "--runs", "6", "--workers", "2"]
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
