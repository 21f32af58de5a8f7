"""``jaxpf track``: how sure it is, and by how much another run would differ."""

import csv

import numpy as np
import pytest
from small_video import BOXES, rows_of, summary_of


def table_of(output):
    with open(output / "uncertainty.csv", newline="") as file:
        return list(csv.DictReader(file))


def column(rows, name):
    return np.array([float(row[name] or np.nan) for row in rows])


def test_the_spread_of_a_run_stands_beside_its_tracks_and_no_error_that_nobody_asked_for(
    whole_run,
):
    rows = table_of(whole_run[1])
    centres = rows_of(whole_run[1])[2:]
    assert len(rows) == len(centres)
    x = centres[:, 2] - 1 + centres[:, 4] / 2
    np.testing.assert_allclose(column(rows, "x"), x, atol=2e-3)
    for name in ("x", "y"):
        spread = column(rows, f"spread_{name}")
        assert np.all(spread > 0)
        low, middle, high = (column(rows, f"{name}_{level}") for level in ("2.5", "50", "97.5"))
        assert np.all((low <= middle) & (middle <= high) & (low < high))
        # Of a normal distribution 3.9; of sixty particles with weights never more than that twice.
        assert np.all(high - low < 2 * 3.9 * spread)
        assert all(row[f"error_{name}"] == "" for row in rows)


def test_runs_side_by_side_tell_how_much_they_differ(track, tmp_path):
    outcome = track(*BOXES, "--runs", 8, "--frames", 4)
    assert outcome.code == 0, outcome.err
    rows = table_of(tmp_path / "out")
    for name in ("x", "y", "scale"):
        error, spread = column(rows, f"error_{name}"), column(rows, f"spread_{name}")
        assert np.all((error > 0) & (error < spread))
    assert (tmp_path / "out" / "overlay.mp4").exists()
    means = summary_of(tmp_path / "out")
    for name in ("1", "2"):
        error = np.mean([column(rows, f"error_{c}")[int(name) - 1 :: 2] for c in ("x", "y")])
        np.testing.assert_allclose(means["mean_error"][name], error, atol=1e-3)
        assert 0 < means["mean_error"][name] < means["mean_spread"][name]
        assert f"{name} {means['mean_error'][name]:.2g} (" in outcome.out


def test_one_run_tells_its_error_by_its_ancestors(track, whole_run, tmp_path):
    outcome = track(*BOXES, "--error-bars", 3, "--no-overlay")
    assert outcome.code == 0, outcome.err
    error = column(table_of(tmp_path / "out"), "error_x")
    assert np.nanmin(error) > 0
    # The answers are those of the run without it.
    assert (tmp_path / "out" / "tracks.csv").read_bytes() == (
        whole_run[1] / "tracks.csv"
    ).read_bytes()


@pytest.mark.parametrize(
    ("flags", "said"),
    [
        (("--runs", 1), "--runs 1 must be a whole number from 2 to 10000"),
        (("--runs", 4, "--error-bars", 3), "use one of them"),
        (("--runs", 10_000, "-n", 1_000_000), "or fewer runs (--runs)"),
        (("--error-bars", 3, "--method", "pffl"), "follow the ancestors of whole particles"),
        (("--runs", 4, "--tracker", "x.py:f"), "jaxpf.filters.SideBySide"),
    ],
)
def test_errors_that_cannot_be_told_are_refused(refuse, flags, said):
    assert said in refuse(*BOXES, *flags)


@pytest.mark.slow
def test_smoothed_tracks_stand_beside_the_others_whole_and_with_a_lag(track, tmp_path):
    found = {}
    for flags in (("--smooth",), ("--smooth-lag", 3)):
        outcome = track(*BOXES, *flags, "--no-overlay", "--overwrite")
        assert outcome.code == 0, outcome.err
        found[flags[0]] = np.loadtxt(tmp_path / "out" / "smoothed.csv", delimiter=",")
        with open(tmp_path / "out" / "smoothed_uncertainty.csv", newline="") as file:
            spread = column(list(csv.DictReader(file)), "spread_x")
    filtered = rows_of(tmp_path / "out")
    for rows in found.values():
        assert rows.shape == filtered.shape
        np.testing.assert_array_equal(rows[:, :2], filtered[:, :2])
        assert np.abs(rows[:, 2:6] - filtered[:, 2:6]).max() < 5
        # Only of the last frame nothing more is known than was.
        assert np.all(np.any(rows[2:-2, 2:6] != filtered[2:-2, 2:6], axis=1))
    known = column(table_of(tmp_path / "out"), "spread_x")
    assert np.all(spread > 0)
    assert spread[:-2].mean() < known[:-2].mean()


@pytest.mark.parametrize(
    ("flags", "said"),
    [
        (("--smooth", "--runs", 3), "looks back over one run"),
        (("--smooth", "--relocate", 0.1), "--relocate 0"),
        (("--smooth", "--method", "pffl"), "cannot be smoothed"),
    ],
)
def test_what_cannot_be_smoothed_is_refused(refuse, flags, said):
    assert said in refuse(*BOXES, *flags)
