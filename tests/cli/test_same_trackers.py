"""The same clip gives the same tracker to ``track`` and to ``evaluate``."""

import jax
import numpy as np
import pytest
from command_line import jaxpf
from small_sequence_folder import write_sequence

from jaxpf import InputError
from jaxpf.cli.tracking import work
from jaxpf.targets import building

BUILD = building.build


@pytest.fixture
def built(monkeypatch):
    """Trackers that commands build, which then stop."""
    trackers = []

    def build_and_stop(*arguments):
        trackers.append(BUILD(*arguments))
        raise InputError("built")

    for module in (building, work):
        monkeypatch.setattr(module, "build", build_and_stop)
    return trackers


@pytest.mark.parametrize(
    ("method", "options"),
    [("dps", ()), ("sir", ("--motion", "pixels")), ("dps", ("--appearance", "colour"))],
)
def test_track_and_evaluate_of_a_folder_build_equal_trackers(built, tmp_path, method, options):
    folder = write_sequence(tmp_path / "two")
    start = ("--boxes", folder / "gt.csv", "--method", method)
    outcome = jaxpf("track", folder, *start, "-n", 20, *options, "-o", tmp_path / "t")
    assert "built" in outcome.err
    place = ("-o", tmp_path / "e")
    outcome = jaxpf("evaluate", folder, "--methods", method, "-n", 20, *options, *place)
    assert "built" in outcome.err
    tracked, evaluated = built
    assert jax.tree.structure(tracked) == jax.tree.structure(evaluated)
    for one, other in zip(jax.tree.leaves(tracked), jax.tree.leaves(evaluated), strict=True):
        np.testing.assert_array_equal(one, other)
