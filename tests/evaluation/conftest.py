"""Evaluations that many tests start from."""

import pytest
from small_evaluation import RUNS, TWICE, small_plan

from jaxpf.evaluation import evaluate


@pytest.fixture(scope="session")
def whole(tmp_path_factory):
    """An uninterrupted evaluation of two files per configuration."""
    folder = tmp_path_factory.mktemp("whole")
    return evaluate(small_plan(runs=TWICE), folder, runs_per_batch=RUNS)


@pytest.fixture
def without_scores(monkeypatch):
    """Leave out HOTA and its like, which take a third of the time and have tests of their own."""
    monkeypatch.setattr("jaxpf.evaluation.summaries.has_scores", lambda: False)


@pytest.fixture
def part(tmp_path, whole):
    """A folder with the first half of the same evaluation."""
    return evaluate(small_plan(runs=RUNS), tmp_path / "part", runs_per_batch=RUNS).folder
