"""Evaluations go on where they stopped, and are never mixed."""

import errno
import functools
import json
import os
import signal
import subprocess
import sys
import time

import jax
import numpy as np
import pytest
from refusals import message_of
from small_evaluation import (
    HERE,
    RUNS,
    TWICE,
    assert_equal_bits,
    content,
    names,
    small_plan,
    small_scene,
    stamps,
)

from jaxpf import InputError
from jaxpf.evaluation import Results, evaluate
from jaxpf.evaluation.engine import prepare
from jaxpf.files import writing as files
from jaxpf.files.store import LOCK, SETTINGS, locked


def test_more_runs_are_added_and_only_missing_ones_are_done_again(whole, part):
    before = stamps(part)
    results = evaluate(small_plan(runs=TWICE), part, runs_per_batch=RUNS)
    assert results.runs == TWICE
    assert before.items() <= stamps(part).items()
    assert_equal_bits(content(results), content(whole))
    (part / "batches" / names(part)[1]).unlink()
    before, done = stamps(part), []
    assert prepare(small_plan(runs=TWICE), part).missing_runs > 0
    results = evaluate(small_plan(runs=TWICE), part, runs_per_batch=RUNS, progress=done.append)
    assert done == [RUNS]
    assert before.items() <= stamps(part).items()
    assert_equal_bits(content(results), content(whole))


def without_the_last_frame(path):
    with np.load(path) as arrays:
        kept = {name: arrays[name] for name in arrays}
    np.savez(path, **(kept | {"shapes": kept["shapes"][:, :-1]}))


def truncated(path):
    """What else damages a piece is proved in ``tests/files/test_store.py``."""
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


@pytest.mark.parametrize("harm", [truncated, without_the_last_frame])
def test_a_damaged_batch_is_found_and_done_again(part, harm):
    path = part / "batches" / names(part)[0]
    intact = content(Results.open(part))
    harm(path)
    prepared = prepare(small_plan(), part)
    assert (prepared.damaged, prepared.missing_runs) == ([path], RUNS)
    assert prepare(small_plan(), part).missing_runs > 0
    results = evaluate(small_plan(), part)
    assert prepare(small_plan(), part).missing_runs == 0
    assert_equal_bits(content(results), intact)


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"seed": 1}, "seed = 0, now 1"),
        ({"sharpness": [20, 30]}, "sharpness = nothing, now 20,30"),
        ({"methods": ["sir"]}, "methods = sir,dps, now sir"),
        ({"runs": RUNS - 1}, f"runs = {RUNS}, now {RUNS - 1}"),
        (
            {"scene": functools.partial(small_scene.func, **small_scene.keywords | {"seed": 1})},
            "scene: seed = 0, now 1",
        ),
    ],
)
def test_changed_settings_are_refused_by_name_with_both_values(part, change, named):
    before = stamps(part)
    message = message_of(evaluate, small_plan(**change), part)
    assert named in message
    assert f"'{part}'" in message
    assert stamps(part) == before


def test_another_precision_or_version_and_what_is_no_evaluation_are_refused(part, tmp_path):
    with jax.enable_x64(True):
        assert "double" in message_of(evaluate, small_plan(runs=TWICE), part)
    path = part / SETTINGS
    settings = json.loads(path.read_text())
    settings["versions"]["jaxpf"] = "0.0.9"
    for text in (json.dumps(settings), "{", "[]", "{}", ""):
        path.write_text(text)
        named = "0.0.9" if "0.0.9" in text else "settings.json"
        assert named in message_of(evaluate, small_plan(), part)
    path.unlink()
    assert "'batches'" in message_of(evaluate, small_plan(), part)
    other = tmp_path / "other"
    other.mkdir()
    file = other / "thesis.tex"
    file.write_text("precious")
    for place in (other, file, file / "below"):
        assert f"'{place}'" in message_of(evaluate, small_plan(), place)
    assert f"'{other}'" in message_of(Results.open, other)
    assert file.read_text() == "precious"


def test_a_scene_that_changed_on_disk_is_refused(tmp_path, monkeypatch, whole):
    """Its description is the same, its pictures are not."""
    evaluate(small_plan(the_scene), tmp_path / "results")
    monkeypatch.setattr(sys.modules[__name__], "brightness", 1)
    with pytest.raises(InputError, match="has other pictures or boxes than when"):
        evaluate(small_plan(the_scene, runs=TWICE), tmp_path / "results")
    assert len(names(tmp_path / "results")) == 2


brightness = 0


def the_scene():
    scene = small_scene()
    scene.frames[3] += np.uint8(brightness)
    return scene


def test_two_processes_cannot_evaluate_into_one_folder(part):
    with locked(part, "evaluating"):
        assert "another process" in message_of(evaluate, small_plan(runs=TWICE), part)
    # It is given back, also after an error that is not the lock's own.
    with pytest.raises(FileNotFoundError, match="elsewhere"), locked(part, "evaluating"):
        raise FileNotFoundError("elsewhere")
    assert evaluate(small_plan(), part, runs_per_batch=RUNS).runs == RUNS


def test_a_full_disk_is_one_sentence_and_finished_batches_stay(whole, tmp_path, monkeypatch):
    """The disk fills up while the third of four batches is written."""
    replace, replaced = os.replace, []

    def full(source, target):
        if str(target).endswith(".npz") and "batches" in str(target):
            replaced.append(target)
            if len(replaced) == 3:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return replace(source, target)

    monkeypatch.setattr(files.os, "replace", full)
    with pytest.raises(InputError, match="no space left on device") as error:
        evaluate(small_plan(runs=TWICE), tmp_path, runs_per_batch=RUNS)
    assert "\n" not in str(error.value)
    monkeypatch.undo()
    assert len(names(tmp_path)) == 2
    before = stamps(tmp_path)
    results = evaluate(small_plan(runs=TWICE), tmp_path, runs_per_batch=RUNS)
    assert before.items() <= stamps(tmp_path).items()
    assert_equal_bits(content(results), content(whole))


def test_leavings_of_a_killed_start_do_not_stand_in_the_way(whole, tmp_path):
    (tmp_path / "batches").mkdir()
    (tmp_path / LOCK).touch()
    (tmp_path / ".settings.77.partial.json").write_text("{")
    leaving = tmp_path / "batches" / ".0000-00000000.77.partial.npz"
    results = evaluate(small_plan(), tmp_path)
    leaving.write_bytes(b"half")
    assert prepare(small_plan(), tmp_path).missing_runs == 0
    results = evaluate(small_plan(runs=TWICE), tmp_path, runs_per_batch=RUNS)
    assert not leaving.exists()
    assert_equal_bits(content(results), content(whole))


@pytest.mark.slow
def test_killing_it_loses_only_the_batch_in_flight(whole, tmp_path):
    """SIGKILL, again and again, whenever two more batches are on disk."""
    runs = 40 * RUNS
    code = f"""
from jaxpf.cli.shared.startup import use_compile_cache
use_compile_cache()
from jaxpf.evaluation import evaluate
from small_evaluation import small_plan
evaluate(small_plan(runs={runs}), {str(tmp_path)!r}, runs_per_batch={RUNS})
"""
    known: dict[str, int] = {}
    for _ in range(2):
        process = subprocess.Popen([sys.executable, "-c", code], cwd=HERE)
        deadline = time.monotonic() + 600
        while len(list(tmp_path.glob("batches/0*.npz"))) < len(known) + 2:
            assert process.poll() is None
            assert time.monotonic() < deadline
            time.sleep(0.005)
        process.send_signal(signal.SIGKILL)
        assert process.wait() == -signal.SIGKILL
        found = {n: t for n, t in stamps(tmp_path).items() if not n.startswith(".")}
        assert known.items() <= found.items()  # nothing was done twice
        assert len(found) < 80
        known = found
        for name in known:
            with np.load(tmp_path / "batches" / name) as arrays:
                assert len(arrays["runs"]) == RUNS
    results = evaluate(small_plan(runs=runs), tmp_path, runs_per_batch=RUNS)
    assert known.items() <= stamps(tmp_path).items()
    found = content(results)
    np.testing.assert_array_equal(found[1, "runs"], np.arange(runs))
    first = {name: value[:TWICE] for name, value in found.items()}
    assert_equal_bits(first, content(whole))
