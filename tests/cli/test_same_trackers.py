"""The same clip gives the same tracker to ``track`` and to ``evaluate``."""

import pytest
from command_line import assert_same, built_by_track, jaxpf
from small_sequence_folder import write_sequence

from jaxpf import InputError
from jaxpf.targets import building

BUILD = building.build


@pytest.fixture
def built(monkeypatch):
    """Trackers that evaluations build, which then stop."""
    trackers = []

    def build_and_stop(*arguments):
        trackers.append(BUILD(*arguments))
        raise InputError("built")

    monkeypatch.setattr(building, "build", build_and_stop)
    return trackers


@pytest.mark.parametrize(
    ("method", "options"),
    [("dps", ()), ("sir", ("--motion", "pixels", "--appearance", "colour"))],
)
def test_track_and_evaluate_of_a_folder_build_equal_trackers(built, tmp_path, method, options):
    folder = write_sequence(tmp_path / "two")
    start = ("--boxes", folder / "gt.csv", "--method", method)
    _, tracked = built_by_track("boxes", folder, *start, "-n", 20, *options)
    place = ("-o", tmp_path / "e")
    outcome = jaxpf("evaluate", folder, "--methods", method, "-n", 20, *options, *place)
    assert "built" in outcome.err
    assert_same(built[-1], tracked)
