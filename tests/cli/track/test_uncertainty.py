"""``jaxpf track``: how sure it is, and by how much another run would differ."""

import csv

import numpy as np
import pytest
from small_video import BOXES, rows_of


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
        (("--runs", 4, "--tracker", "x.py:f"), "jaxpf.uncertainty.SideBySide"),
    ],
)
def test_errors_that_cannot_be_told_are_refused(refuse, flags, said):
    assert said in refuse(*BOXES, *flags)
