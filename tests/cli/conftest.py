"""Evaluations of the tests are not timed, which compiles once more, unless a test is about it."""

import pytest

from jaxpf.evaluation import speed

MEASURE_SPEEDS = speed.measure_speeds


@pytest.fixture(scope="session", autouse=True)
def not_timed():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(speed, "measure_speeds", lambda *arguments: None)
        yield


@pytest.fixture
def timed(monkeypatch):
    monkeypatch.setattr(speed, "measure_speeds", MEASURE_SPEEDS)
