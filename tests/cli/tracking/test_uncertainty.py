"""``jaxpf track``: how sure it is, and by how much another run would differ."""

import numpy as np
import pytest
from small_video import BOXES, summary_of

from jaxpf.boxes import read_tracks


def test_a_run_reports_no_monte_carlo_error_unless_requested(whole_run):
    assert "x_mc_error" not in read_tracks(whole_run[1] / "tracks.csv")
    assert summary_of(whole_run[1])["mean_mc_error"] is None


@pytest.mark.slow
def test_runs_side_by_side_tell_how_much_they_differ(track, tmp_path):
    outcome = track(*BOXES, "--runs", 8, "--frames", 4)
    assert outcome.code == 0, outcome.err
    table = read_tracks(tmp_path / "out" / "tracks.csv")
    for name in ("x", "y"):
        error = table[f"{name}_mc_error"][2:]
        assert np.all(error > 0)
        assert np.all(error < table[f"{name}_97.5"][2:] - table[f"{name}_2.5"][2:])
    assert (tmp_path / "out" / "overlay.mp4").exists()
    for name, error in summary_of(tmp_path / "out")["mean_mc_error"].items():
        rows = table["id"] == int(name)
        errors = np.stack([table["x_mc_error"][rows], table["y_mc_error"][rows]])
        np.testing.assert_allclose(error, np.nanmean(errors), atol=1e-3)
        assert f"{name} {error:.2g}" in outcome.out
