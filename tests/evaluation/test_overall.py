"""Tables over several sequences: sequences are the units, whatever their runs and orders."""

import csv

import numpy as np
import pytest
from scipy import stats

from jaxpf import measures
from jaxpf.evaluation.output import charts
from jaxpf.evaluation.output.overall import FILES, over_sequences, write_overall

SHARES = (0.0, 1.0)
HEADER = ["scene", "method", "ordering", "gain", "object", "measure", "runs", "value"]


def write(folder, name, rows, curve=lambda threshold: 1 - threshold):
    """Tables of one sequence: ``rows``, and for each method of them the same curves."""
    (folder / name).mkdir()
    with open(folder / name / "summary.csv", "w", newline="") as file:
        csv.writer(file).writerows([HEADER, *([name, *row] for row in rows)])
    keys = dict.fromkeys(tuple(row[:4]) for row in rows)
    with open(folder / name / "curves.csv", "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow([*HEADER[:5], "curve", "threshold", "value", "lower", "upper"])
        for key in keys:
            for t in measures.OVERLAP_THRESHOLDS:
                writer.writerow([name, *key, "success", f"{t:g}", curve(t), "", ""])
            for t in measures.CENTRE_THRESHOLDS:
                writer.writerow([name, *key, "precision", f"{t:g}", 1 - curve(t / 50), "", ""])


def test_shares_are_means_over_sequences_and_other_values_medians():
    values = np.array([0.5, 0.75, np.nan, 0.7])
    known = values[np.isfinite(values)]
    found = over_sequences(values, SHARES)
    wanted = measures.mean_interval(known, bounds=SHARES)
    assert found == pytest.approx((3, wanted.value, wanted.lower, wanted.upper), abs=0.02)
    low, high = stats.t.interval(0.95, 2, known.mean(), stats.sem(known))
    assert 0 <= found.lower < max(low, 0)
    assert found.upper == pytest.approx(min(high, 1))
    errors = np.array([2.0, 1, 3, 900, 4, 5])
    assert over_sequences(errors, None) == (6, 3.5, 1, 900)
    differences = over_sequences(errors, None, np.array([np.nan, 0, 0, 0, 0, 0]))
    np.testing.assert_equal(differences, (5, 4, np.nan, np.nan))
    assert np.isnan(over_sequences(values[:2], SHARES).lower)
    assert over_sequences(values[:0], SHARES).sequences == 0


def test_orders_of_a_method_are_averaged_and_differences_are_paired(tmp_path):
    def rows(sir, ps):
        return [
            ["SIR", "", "2.0", "all", "overlap", 9, sir],
            ["SIR", "", "2.0", "1", "overlap", 9, 0.0],  # of one object: does not count
            *(
                ["PS", order, "2.0", "all", "overlap", 9, x]
                for order, x in zip("ab", ps, strict=False)
            ),
        ]

    write(tmp_path, "one", rows(0.5, [0.5, 0.7]))
    write(tmp_path, "two", rows(0.4, [0.6]))
    write(tmp_path, "three", rows(0.9, []))
    means, differences = write_overall(tmp_path, ["one", "two", "three"], ["gain"])
    assert means.columns[:2] == ["method", "sequences"]
    assert [row[:2] for row in means.texts()] == [["SIR, gain 2.0", "3"], ["PS, gain 2.0", "2"]]
    assert means.texts()[0][2].startswith("60 [")
    assert means.texts()[1][2].startswith("60")  # .6 of both sequences
    with open(tmp_path / "overall.csv", newline="") as file:
        found = [row for row in csv.DictReader(file) if row["what"] == "difference"]
    (row,) = found
    # Only sequences that both have count: .6 - .5 and .6 - .4.
    assert (row["method"], row["sequences"]) == ("PS, gain 2.0", "2")
    assert float(row["value"]) == pytest.approx(0.15)
    assert row["lower"] == row["upper"] == ""  # two decide nothing
    assert differences.title == "differences from SIR, gain 2.0, paired by sequence"
    assert {path.name for path in tmp_path.iterdir() if path.is_file()} == set(FILES)
    text = (tmp_path / "overall.md").read_text()
    assert "Sequences are the units" in text
    assert "Fewer than 10 sequences are a preview and decide nothing." in text
    assert "nan" not in text
    assert "Runs are the independent units" not in text
    with open(tmp_path / "sequences.csv", newline="") as file:
        assert len(list(csv.DictReader(file))) == 5


@pytest.mark.parametrize("varied", [[], ["gain"]])
def test_only_options_that_vary_stand_in_names(tmp_path, varied):
    for name in ("one", "two"):
        write(tmp_path, name, [["SIR", "", "2.0", "all", "overlap", 9, 0.5]])
    (means,) = write_overall(tmp_path, ["one", "two"], varied)
    assert means.texts()[0][0] == ("SIR, gain 2.0" if varied else "SIR")


def test_curves_are_means_over_sequences_with_their_intervals(tmp_path, monkeypatch):
    drawn = {}

    def keep(methods, curves):
        drawn.update(curves)
        return right(methods, curves)

    right = charts.accuracy_curves
    monkeypatch.setattr(charts, "accuracy_curves", keep)
    row = ["SIR", "", "2.0", "all", "overlap", 9, 0.5]
    write(tmp_path, "one", [row, ["PS", *row[1:]]])
    write(tmp_path, "two", [row], lambda threshold: 1 - threshold**2)
    write(tmp_path, "three", [row])
    write_overall(tmp_path, ["one", "two", "three"], [])
    at_half = [0.5, 0.75, 0.5]
    wanted = measures.mean_interval(at_half, bounds=SHARES)
    np.testing.assert_allclose(
        drawn["SIR", "success"][:, 10], (wanted.value, wanted.lower, wanted.upper)
    )
    np.testing.assert_allclose(drawn["SIR", "precision"][0, 25], 1 - np.mean(at_half))
    assert drawn["PS", "success"][0, 10] == 0.5
    assert np.isnan(drawn["PS", "success"][1:, 10]).all()
