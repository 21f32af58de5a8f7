"""What is collected over the runs: shown tracks, quantiles, curves, in bounded memory."""

import csv
import math
import tracemalloc

import jax
import numpy as np
import pytest
from made_results import PS, SIR, batch, make, walks
from two_objects import TRUE

from jaxpf.boxes import read_boxes
from jaxpf.evaluation import collection
from jaxpf.evaluation.collection import ErrorQuantiles
from jaxpf.evaluation.output.tables import write_tables
from jaxpf.measures import mean_interval


def test_tracks_of_the_best_median_and_worst_run(tmp_path):
    truth = np.broadcast_to(np.array(TRUE), (4, 1, 4))
    offsets = [3.0, 0.0, 9.0, 1.0, 30.0]  # of the runs: the second is best, the fourth median
    boxes = np.stack([truth + np.array([offset, 0, 0, 0]) for offset in offsets])
    lost = np.zeros((5, 4, 1), bool)
    lost[4, 2] = True
    parts = [batch(boxes[:3], lost=lost[:3]), batch(boxes[3:], 3, lost=lost[3:])]
    results = make(tmp_path / "results", [(PS, parts)], truth, ids=[6], start_frame=10)
    (tmp_path / "results" / "tracks").mkdir()
    old = tmp_path / "results" / "tracks" / "01-PS-21-best-run7.txt"
    old.touch()
    write_tables(results)
    names = sorted(path.name for path in (results.folder / "tracks").iterdir())
    assert names == [
        *("01-PS-21-best-run1.txt", "01-PS-21-median-run0.txt", "01-PS-21-worst-run4.txt"),
        "truth.txt",
    ]
    worst = read_boxes(results.folder / "tracks" / names[2])
    np.testing.assert_allclose(worst.box, boxes[4, :, 0], atol=1e-3)
    assert worst.frame.tolist() == [11, 12, 13, 14]
    assert set(worst.id.tolist()) == {6}
    lines = (results.folder / "tracks" / names[2]).read_text().splitlines()
    assert [line.split(",")[6] for line in lines] == ["1", "1", "0", "1"]


def test_quantiles_are_within_a_hundredth():
    random = np.random.default_rng(4)
    errors = random.lognormal(1, 1.5, (400, 3, 2))
    errors[:, 0, 0] = math.nan
    errors[5, 1, 1] = math.nan
    counted = ErrorQuantiles(300, 2)
    many = np.tile(errors, (1, 100, 1))
    counted.add(many[:150])
    counted.add(many[150:])
    levels = (0.05, 0.25, 0.5, 0.75, 0.95)
    got = counted.quantiles(levels)
    np.testing.assert_array_equal(got, np.tile(got[:, :3], (1, 100, 1)))
    assert np.isnan(got[:, 0, 0]).all()
    for place, values in ((0, errors[:, :, 0]), (1, errors[:, :, 1])):
        for frame in (1, 2):
            known = values[:, frame][np.isfinite(values[:, frame])]
            exact = np.quantile(known, levels, method="inverted_cdf")
            np.testing.assert_allclose(got[:, frame, place], exact, rtol=0.0101)
    pooled = errors[:, 2].reshape(-1)
    exact = np.quantile(pooled, levels, method="inverted_cdf")
    np.testing.assert_allclose(got[:, 2, 2], exact, rtol=0.0101)


def test_curves_are_means_over_runs(tmp_path):
    from jaxpf.measures import precision_curve, success_curve

    truth, boxes = walks(seed=8, runs=30, frames=6, objects=2)
    results = make(tmp_path / "results", [(SIR, [batch(boxes[:20]), batch(boxes[20:], 20)])], truth)
    (summary,) = write_tables(results).summaries
    for found, curve in ((summary.success, success_curve), (summary.precision, precision_curve)):
        curves = jax.jit(curve)(np.float32(boxes), truth)
        wanted = jax.jit(mean_interval)(curves)
        np.testing.assert_allclose(found.value[:2], wanted.value, atol=1e-6)
        np.testing.assert_allclose(found.lower[:2], wanted.lower, atol=1e-5)
        np.testing.assert_allclose(found.upper[:2], wanted.upper, atol=1e-5)
        if curve is success_curve:
            area = summary.estimates["success_area"].value[2]
            assert area == pytest.approx(float(np.mean(curves)), rel=1e-5)
    with open(results.folder / "curves.csv", newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["object"] == "all"]
    assert [row["curve"] for row in rows] == ["success"] * 21 + ["precision"] * 51
    (at_20,) = (row for row in rows if (row["curve"], row["threshold"]) == ("precision", "20"))
    assert float(at_20["value"]) == pytest.approx(np.mean(summary.precision.value[2, 20]))


@pytest.mark.slow
def test_memory_does_not_grow_with_the_runs(tmp_path, monkeypatch):
    """10 000 runs, a hundred at a time: their arrays take 4.4 MB, their rows 5 MB."""
    monkeypatch.setattr(collection, "SCORED_RUNS", 1)
    truth, boxes = walks(seed=10, runs=100, frames=6, objects=2)
    peaks = []
    write_tables(make(tmp_path / "first", [(SIR, [batch(boxes)])], truth))  # compiles
    for count in (10, 100):
        parts = [batch(boxes, first) for first in range(0, 100 * count, 100)]
        results = make(tmp_path / f"{count}", [(SIR, parts)], truth)
        del parts
        tracemalloc.start()
        made = write_tables(results)
        peaks.append(tracemalloc.get_traced_memory()[1] / 1e6)
        tracemalloc.stop()
        assert made.summaries[0].runs == 100 * count
    with open(tmp_path / "100" / "results.csv", encoding="utf-8") as file:
        assert sum(1 for _ in file) == 20_001
    assert peaks[1] - peaks[0] < 1.5, peaks
