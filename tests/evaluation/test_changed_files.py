"""A finished evaluation whose scene's files have changed is not shown as current."""

import functools

import pytest
from small_evaluation import ONE, small_plan
from small_sequence_folder import write_sequence

from jaxpf import InputError
from jaxpf.evaluation import evaluate, finished
from jaxpf.evaluation.fingerprint import fingerprint
from jaxpf.evaluation.opening import load_scene


@pytest.fixture
def folder(tmp_path):
    return write_sequence(tmp_path / "two")


def of(folder):
    return functools.partial(load_scene, source=str(folder))


@pytest.mark.slow
def test_edited_truth_is_refused_and_not_shown_again(folder, tmp_path):
    plan = small_plan(of(folder), methods=("sir",))
    evaluate(plan, tmp_path / "out", limits=ONE)
    assert finished(plan, tmp_path / "out") is not None
    truth = (folder / "gt.csv").read_text()
    lines = truth.splitlines()
    frame, identity, x, *rest = lines[-1].split(",")
    lines[-1] = ",".join([frame, identity, str(float(x) + 1), *rest])
    (folder / "gt.csv").write_text("\n".join(lines) + "\n")
    assert finished(plan, tmp_path / "out") is None
    with pytest.raises(InputError, match="has other pictures or boxes than when"):
        evaluate(plan, tmp_path / "out", limits=ONE)
    (folder / "gt.csv").write_text(truth)
    assert finished(plan, tmp_path / "out") is not None


@pytest.mark.slow
def test_files_that_were_only_touched_lead_to_the_same_results(folder, tmp_path):
    plan = small_plan(of(folder), methods=("sir",))
    evaluate(plan, tmp_path / "out", limits=ONE)
    (folder / "0003.png").touch()
    assert finished(plan, tmp_path / "out") is None
    results = evaluate(plan, tmp_path / "out", limits=ONE)
    assert finished(plan, tmp_path / "out") is not None
    assert results.finished(results.configurations[0]) == plan.runs


def test_a_fingerprint_is_of_the_files_and_nothing_else(folder, tmp_path):
    before = fingerprint(of(folder))
    assert before == fingerprint(of(folder))
    (folder / "0001.png").unlink()
    assert fingerprint(of(folder)) != before
    assert fingerprint(functools.partial(load_scene, source="distracter")) is None
    (tmp_path / "mine.py").write_text("a = 1")
    mine = fingerprint(of(f"{tmp_path}/mine.py:scene"))
    (tmp_path / "mine.py").write_text("a = 2")
    assert fingerprint(of(f"{tmp_path}/mine.py:scene")) not in (mine, None)
