"""What is collected over the runs: quantiles, curves, in bounded memory."""

import math

import numpy as np
import pytest
from csv_rows import rows_of
from made_results import SIR, batch, make, value, walks

from jaxpf.evaluation.summaries import QUANTILES, error_quantiles
from jaxpf.evaluation.tables import write_tables
from jaxpf.measures import mean_interval
from jaxpf.measures.scores import CENTRE_THRESHOLDS, success_curve

pytestmark = pytest.mark.usefixtures("without_scores")


def test_quantiles_are_those_of_runs_and_objects_in_every_frame():
    errors = np.random.default_rng(4).lognormal(1, 1.5, (400, 3, 2))
    errors[:, 0, 0] = math.nan
    errors[5, 1, 1] = math.nan
    errors[:, 2] = math.nan
    quantiles = error_quantiles(errors)
    np.testing.assert_allclose(quantiles[:, 0], np.quantile(errors[:, 0, 1], QUANTILES))
    pooled = errors[:, 1][np.isfinite(errors[:, 1])]
    np.testing.assert_allclose(quantiles[:, 1], np.quantile(pooled, QUANTILES))
    assert np.isnan(quantiles[:, 2]).all()


def test_curves_are_means_over_runs(tmp_path):
    truth, boxes = walks(seed=8, runs=30, frames=6, objects=2)
    results = make(tmp_path / "results", [(SIR, [batch(boxes[:20]), batch(boxes[20:], 20)])], truth)
    made = write_tables(results)
    tables = made.curves.set_index(["curve", "object"]).sort_index()
    offset = (boxes + boxes[..., [2, 3, 0, 1]] / 2 - truth - truth[..., [2, 3, 0, 1]] / 2)[..., :2]
    within = np.linalg.norm(offset, axis=-1)[..., None] <= CENTRE_THRESHOLDS
    of_runs = {"success": success_curve(boxes, truth), "precision": within.mean(axis=1)}
    for name, curves in of_runs.items():
        wanted = mean_interval(curves, bounds=(0, 1))
        for place, of in enumerate("12"):
            for end in ("value", "lower", "upper"):
                found = tables.loc[name, of][end]
                np.testing.assert_allclose(found, getattr(wanted, end)[place], atol=1e-5)
    area = float(np.mean(of_runs["success"]))
    assert value(made, 0, "success_auc") == pytest.approx(area, rel=1e-5)
    rows = [row for row in rows_of(results.folder / "curves.csv") if row["object"] == "all"]
    assert [row["curve"] for row in rows] == ["success"] * 21 + ["precision"] * 51
    (at_20,) = (row for row in rows if (row["curve"], row["threshold"]) == ("precision", "20"))
    assert float(at_20["value"]) == pytest.approx(np.mean(curves[..., 20]))


def test_reliability_and_area_of_confidence_by_hand(tmp_path):
    """Of ten frames, five at confidence .9 and five at .3; boxes leave in known frames."""
    truth = np.broadcast_to(np.array([10.0, 10, 20, 20]), (10, 1, 4))
    boxes = np.stack([truth, truth]).copy()
    confidence = np.full((2, 10, 1), 0.9)
    confidence[:, 5:] = 0.3
    boxes[:, 6:, :, 0] += 100  # four of the doubtful frames are off their object
    boxes[1, 0, :, 0] += 100  # and one of the confident frames, in one run
    boxes[0, 1, :, 0] += 16  # an IoU of 1/9 is still on the object
    boxes[0, 2, :, 0] += 17  # of 3/37 not
    results = make(tmp_path / "results", [(SIR, [batch(boxes, confidence=confidence)])], truth)
    made = write_tables(results)
    (summary,) = made.summaries.values()
    assert summary.confidence.frames.tolist() == [0, 10, 0, 0, 10, 20]
    np.testing.assert_allclose(
        summary.confidence.shares().value, [math.nan, 0.2, math.nan, math.nan, 0.8, 0.5]
    )
    # Pairs of a frame on and one off its object: 8 x 8 apart, 8 x 2 and 2 x 8 level, 2 x 2 wrong.
    assert summary.confidence.area() == pytest.approx((64 + 32 / 2) / 100)
    line = made.remarks[-1]
    assert "0.2 to 0.4: 20%, 0.8 to 1.0: 80%; area under the curve 80%" in line
    assert line.endswith("not reported lost: 10% of all frames.")  # 2 of 20
    every = rows_of(tmp_path / "results" / "summary.csv")
    rows = {row["measure"]: row for row in every if row["object"] == "all"}
    assert float(rows["on_object_4"]["value"]) == pytest.approx(0.8)
    assert float(rows["confidence_area"]["value"]) == pytest.approx(0.8)
    assert float(rows["silent"]["value"]) == pytest.approx(0.1)


def test_regions_of_size_cover_sizes_as_often_as_normal_ones(tmp_path):
    """Scales of the start's 20 x 30 that err by the spread and the model's error together."""
    random = np.random.default_rng(0)
    truth = np.broadcast_to(np.array([10.0, 10, 20, 30]), (200, 1, 4))
    scale = np.exp(0.1 * random.standard_normal((8, 200, 1)))
    boxes = np.broadcast_to(truth, (8, 200, 1, 4)).copy()
    boxes[..., 2:] *= scale[..., None]
    for particles, model, expected in (
        (0.1, 0.0, (0.5, 0.95)),
        (0.06, 0.08, (0.5, 0.95)),
        (0.05, 0.0, (0.264, 0.673)),
    ):
        spread = np.broadcast_to([3.0, 3.0, 1.0], (8, 200, 1, 3)).copy()
        spread[..., 2] = particles * scale
        runs = batch(boxes, spread=spread, model_error=(0, 0, model))
        made = make(tmp_path / f"{particles}", [(SIR, [runs])], truth)
        overview = write_tables(made)
        for percent, share in zip((50, 95), expected, strict=True):
            found = value(overview, 0, f"size_coverage_{percent}")
            error = np.sqrt(share * (1 - share) / 1600)
            assert abs(found - share) < 4.5 * error, (particles, percent, found)


def test_regions_of_the_place_hold_the_error_of_the_model(tmp_path):
    """Places that err by 5 pixels, of which the particles show 3 and the model declares 4."""
    random = np.random.default_rng(1)
    truth = np.broadcast_to(np.array([100.0, 100, 60, 60]), (200, 1, 4))
    boxes = np.broadcast_to(truth, (8, 200, 1, 4)).copy()
    boxes[..., :2] += 5 * random.standard_normal((8, 200, 1, 2))
    runs = batch(boxes, spread=3.0, model_error=(4, 4, 0))
    overview = write_tables(make(tmp_path / "made", [(SIR, [runs])], truth))
    for percent in (50, 95):
        share = percent / 100
        error = np.sqrt(share * (1 - share) / 3200)
        assert abs(value(overview, 0, f"coverage_{percent}") - share) < 4.5 * error
