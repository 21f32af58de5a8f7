"""Tables over several sequences: sequences are the units, whatever their runs and orders."""

import csv

import numpy as np
import pytest
from csv_rows import rows_of

from jaxpf import measures
from jaxpf.evaluation import overall as over
from jaxpf.evaluation.overall import FILES, about_units, write_overall
from jaxpf.measures.scores import CENTRE_THRESHOLDS, IOU_THRESHOLDS

SHARES = (0.0, 1.0)
HEADER = ["scene", "method", "ordering", "sharpness", "object", "measure", "runs", "value"]


def write(folder, name, rows, curve=lambda threshold: 1 - threshold):
    """Tables of one sequence: ``rows``, and for each method of them the same curves."""
    (folder / name).mkdir()

    def write_csv(file, header, lines):
        with open(folder / name / file, "w", newline="") as opened:
            csv.writer(opened).writerows([header, *([name, *line] for line in lines)])

    write_csv("summary.csv", HEADER, rows)
    thresholds = IOU_THRESHOLDS, CENTRE_THRESHOLDS
    points = [("success", t, curve(t)) for t in thresholds[0]]
    points += [("precision", t, 1 - curve(t / 50)) for t in thresholds[1]]
    header = [*HEADER[:5], "curve", "threshold", "value", "lower", "upper"]
    keys = dict.fromkeys(tuple(row[:4]) for row in rows)
    lines = [(*key, kind, f"{t:g}", y, "", "") for key in keys for kind, t, y in points]
    write_csv("curves.csv", header, lines)


def test_orders_of_a_method_are_averaged_and_differences_are_paired(tmp_path):
    def row(method, order, value, of="all"):
        return [method, order, "2.0", of, "iou", 9, value]

    ps = (row("PS", order, value) for order, value in (("a", 0.5), ("b", 0.7)))
    of_one_object = row("SIR", "", 0.0, "1")  # does not count
    write(tmp_path, "one", [row("SIR", "", 0.5), of_one_object, *ps])
    write(tmp_path, "two", [row("SIR", "", 0.4), row("PS", "a", 0.6)])
    write(tmp_path, "three", [row("SIR", "", 0.9)])
    shown = write_overall(tmp_path, ["one", "two", "three"], ["sharpness"])
    means, _ = shown.values()
    assert means.method.tolist() == ["SIR, sharpness 2.0", "PS, sharpness 2.0"]
    assert means.sequences.tolist() == ["3", "2"]
    assert means["IoU (%)"][0].startswith("60 [")
    assert means["IoU (%)"][1].startswith("60")  # .6 of both sequences
    (found,) = (row for row in rows_of(tmp_path / "overall.csv") if row["what"] == "difference")
    # Only sequences that both have count: .6 - .5 and .6 - .4.
    assert (found["method"], found["sequences"]) == ("PS, sharpness 2.0", "2")
    assert float(found["value"]) == pytest.approx(0.15)
    assert found["lower"] == found["upper"] == ""  # two decide nothing
    assert "differences from SIR, sharpness 2.0, paired by sequence" in shown
    assert {path.name for path in tmp_path.iterdir() if path.is_file()} == set(FILES)
    assert "nan" not in (tmp_path / "overall.csv").read_text()
    assert about_units(3).endswith("Fewer than 10 sequences are a preview and decide nothing.")
    assert len(rows_of(tmp_path / "sequences.csv")) == 5


def test_options_that_do_not_vary_stand_in_no_names(tmp_path):
    for name in ("one", "two"):
        write(tmp_path, name, [["SIR", "", "2.0", "all", "iou", 9, 0.5]])
    (means,) = write_overall(tmp_path, ["one", "two"], []).values()
    assert means.method[0] == "SIR"


def test_curves_are_means_over_sequences_with_their_intervals(tmp_path, monkeypatch):
    drawn = {}

    def keep(methods, curves):
        drawn.update(curves)
        return right(methods, curves)

    right = over.accuracy_curves
    monkeypatch.setattr(over, "accuracy_curves", keep)
    row = ["SIR", "", "2.0", "all", "iou", 9, 0.5]
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
