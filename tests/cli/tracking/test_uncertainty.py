"""``jaxpf track``: how sure it is, and by how much another run would differ."""

import numpy as np
import pytest
from small_video import BOXES, summary_of

from jaxpf.boxes import read_tracks
from jaxpf.cli.tracking import writers


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


@pytest.mark.slow
def test_one_run_tells_its_error_by_its_ancestors(track, whole_run, tmp_path):
    outcome = track(*BOXES, "--mc-error-lag", 3, "--no-overlay")
    assert outcome.code == 0, outcome.err
    table = read_tracks(tmp_path / "out" / "tracks.csv")
    for name in ("x_mc_error", "y_mc_error"):
        assert np.nanmin(table.pop(name)) > 0
    # The answers are those of the run without it.
    others = read_tracks(whole_run[1] / "tracks.csv")
    assert list(table) == list(others)
    for name, values in others.items():
        np.testing.assert_array_equal(table[name], values)


@pytest.mark.slow
def test_smoothed_tracks_stand_beside_the_others_whole_and_with_a_lag(track, tmp_path):
    tables = []
    for flags in (("--smooth",), ("--smooth-lag", 3)):
        outcome = track(*BOXES, *flags, "--no-overlay", "--overwrite")
        assert outcome.code == 0, outcome.err
        tables.append(read_tracks(tmp_path / "out" / "smoothed.csv"))
    filtered = read_tracks(tmp_path / "out" / "tracks.csv")
    boxes = np.stack([filtered[name] for name in "xywh"])
    for table in tables:
        for name in ("frame", "id"):
            np.testing.assert_array_equal(table[name], filtered[name])
        smoothed = np.stack([table[name] for name in "xywh"])
        assert np.abs(smoothed - boxes).max() < 5
        # Nothing more becomes known of the last frame alone.
        assert np.all(np.any(smoothed != boxes, axis=0)[2:-2])


@pytest.mark.slow
def test_smoothed_intervals_are_no_narrower_than_filtered_ones(track, tmp_path, monkeypatch):
    def mean_width(name):
        table = read_tracks(tmp_path / "out" / name)
        return np.mean(table["x_97.5"][2:-2] - table["x_2.5"][2:-2])

    smoothed = []
    for share in (0.0, writers._LEAST_SPREAD):
        monkeypatch.setattr(writers, "_LEAST_SPREAD", share)
        outcome = track(*BOXES, "--smooth", "--no-overlay", "--overwrite")
        assert outcome.code == 0, outcome.err
        smoothed.append(mean_width("smoothed.csv"))
    filtered = mean_width("tracks.csv")
    # Those of the smoother itself are narrower.
    assert smoothed[0] < filtered
    assert smoothed[1] > smoothed[0] + 0.8 * (filtered - smoothed[0])
