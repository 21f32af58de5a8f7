"""Tables of an evaluation, by hand and against the library's measures."""

import math

import jax
import numpy as np
import pytest
from csv_rows import rows_of
from made_results import DPS, OTHER, PARAMETERS, PS, SIR, batch, imported, make, value, walks
from small_evaluation import small_scene
from two_objects import BOXES, FAR, NAN, TRUE, TRUTH, found, numbers

from jaxpf import measures as metrics
from jaxpf.evaluation import Plan, tables
from jaxpf.evaluation.engine import prepare
from jaxpf.evaluation.results import Configuration
from jaxpf.evaluation.tables import write_tables
from jaxpf.measures import mean_interval
from jaxpf.measures.metrics import measure_boxes


@pytest.fixture(scope="module")
def by_hand(tmp_path_factory):
    """Three runs in two batches, and another tracker that is right but for one frame."""
    spread = np.broadcast_to([1.0, 8.0, 0.5], (2, 2, 2, 3))
    evidence = np.array([[-1000.25, -2.5], [-3, -math.inf]])
    parts = [
        batch(BOXES[:2], spread=spread, log_evidence=evidence),
        batch(BOXES[2:], first_run=2, without_likelihood=[[[True, False], [True, True]]]),
    ]
    other = [imported(np.array([[TRUE, NAN], [FAR, TRUE]]))]
    batches = [(SIR, parts), (OTHER, other)]
    folder = tmp_path_factory.mktemp("hand") / "results"
    results = make(folder, batches, TRUTH, ids=[4, 9], start_frame=5)
    return results, write_tables(results)


def test_every_run_and_object_has_a_row(by_hand):
    rows = rows_of(by_hand[0].folder / "results.csv")
    assert [(r["method"], r["run"], r["object"]) for r in rows] == [
        *(("SIR", f"{run}", identity) for run in range(3) for identity in "49"),
        *((OTHER.method, "0", identity) for identity in "49"),
    ]
    assert {(r["scene"], r["seed"]) for r in rows} == {("made <scene>", "7")}
    assert [r["noise_pixels"] for r in rows] == 6 * ["2,4,0.5"] + 2 * [""]


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        # SIR: run 0 of objects 4 and 9, run 1, run 2; then the other tracker.
        ("frames", [2, 1, 2, 1, 2, 1, 2, 1]),
        ("tracked_frames", [2, 1, 1, 0, 1, 0, 1, 1]),
        ("success", [1, 1, 0, 0, 0, 0, 0, 1]),
        ("recovered", [1, 1, 1, 0, 0, 0, 0, 1]),
        ("tracked_share", [1, 1, 0.5, 0, 0.5, 0, 0.5, 1]),
        ("precision", [0.75, 1, 1, math.nan, 1, math.nan, 1, 1]),
        ("precision_all", [0.75, 1, 0.5, 0, 0.5, 0, 0.5, 1]),
        ("iou", [(1 + 1 / 3) / 2, 1, 0.5, 0, 0.5, 0, 0.5, 1]),
        # Of SIR's first run one frame overlaps by a third.
        ("success_rate_50", [0.5, 1, 0.5, 0, 0.5, 0, 0.5, 1]),
        ("success_auc", [(20 + 7) / 42, 20 / 21, 10 / 21, 0, 10 / 21, 0, 10 / 21, 20 / 21]),
        ("distance_precision", [1, 1, 0.5, 0, 0.5, 0, 0.5, 1]),
        # A box that is not there has no centre.
        ("located_frames", [2, 1, 2, 1, 2, 0, 2, 1]),
        ("centre_error", [2.5, 0, 25, 50, 25, math.nan, 25, 0]),
        ("distinct_share", [*6 * [0.5], math.nan, math.nan]),
        # Offsets: of the first run (0, 0) and (5, 0), of the others none where they are followed;
        # spreads (1, 8) and (2, 2).
        ("coverage_50", [0.75, 1, 1, math.nan, 1, math.nan, math.nan, math.nan]),
        ("coverage_95", [0.75, 1, 1, math.nan, 1, math.nan, math.nan, math.nan]),
        ("ess", [*6 * [30], math.nan, math.nan]),
        ("log_evidence", [*2 * [-1002.75], *2 * [-math.inf], *2 * [-3], math.nan, math.nan]),
        ("frames_without_likelihood", [0, 0, 0, 0, 2, 1, 0, 1]),
    ],
)
def test_measures_of_runs_by_hand(by_hand, name, expected):
    rows = rows_of(by_hand[0].folder / "results.csv")
    np.testing.assert_allclose(numbers(rows, name), expected, rtol=1e-6)


def test_summary_by_hand(by_hand):
    folder = by_hand[0].folder
    success = found(folder, "success", 4)
    wanted = mean_interval([1, 0, 0], bounds=(0, 1))
    for field in ("value", "lower", "upper"):
        assert success[field] == pytest.approx(getattr(wanted, field), rel=1e-6)
    # Tracked frames of the runs: two with a precision of .75, then one of 1 and one of 1.
    assert found(folder, "precision", 4)["value"] == pytest.approx((2 * 0.75 + 1 + 1) / 4)
    # All objects: 1, .5, 0 of their frames weigh in (2, 1).
    everything = found(folder, "iou", "all")
    runs = [(2 * (2 / 3) + 1) / 3, (2 * 0.5 + 0) / 3, (2 * 0.5 + 0) / 3]
    assert everything["value"] == pytest.approx(np.mean(runs))
    assert everything["standard_error"] == pytest.approx(np.std(runs, ddof=1) / math.sqrt(3))
    # A run whose evidence is zero has no logarithm to average.
    assert found(folder, "log_evidence", 4)["runs"] == 2


def test_imported_tracks_have_values_without_intervals(by_hand):
    results, made = by_hand
    row = found(results.folder, "success", 9, OTHER.method)
    assert row["value"] == 1
    assert np.isnan([row["lower"], row["upper"]]).all()
    rows = rows_of(results.folder / "summary.csv")
    measured = {row["measure"] for row in rows if row["method"] == OTHER.method}
    assert "iou" in measured
    assert "distinct_share" not in measured
    assert made.differences.empty
    assert any("one track, the same for every seed" in remark for remark in made.remarks)


@pytest.mark.usefixtures("without_scores")
@pytest.mark.parametrize("size", [7, 60])
def test_summary_agrees_with_the_librarys_measures(tmp_path, size):
    truth, boxes = walks(seed=3, runs=60, frames=6, objects=2)
    truth[4:, 1] = math.nan
    boxes[7, 2, 0] = math.nan
    parts = [batch(boxes[first : first + size], first) for first in range(0, 60, size)]
    results = make(tmp_path / "results", [(SIR, parts)], truth)
    write_tables(results)
    expected = metrics.summarise(boxes, truth)
    names = {"success_rate": "success", "recovery_rate": "recovered", "tracked": "tracked_share"}
    names |= {name: name for name in ("precision", "recall", "precision_all", "recall_all")}
    for name, measure in (names | {"iou": "iou", "centre_error": "centre_error"}).items():
        for place, identity in enumerate((1, 2)):
            row = found(results.folder, measure, identity)
            for field in ("value", "standard_error", "lower", "upper"):
                wanted = float(getattr(expected[name], field)[place])
                close = pytest.approx(wanted, rel=2e-5, abs=1e-7, nan_ok=True)
                assert row[field] == close, (name, field)


@pytest.mark.usefixtures("without_scores")
def test_methods_are_compared_on_common_runs_at_equal_parameters(tmp_path):
    truth, boxes = walks(seed=5, runs=12, frames=6, objects=2)
    sharp = {**PARAMETERS, "sharpness": 40.0}
    without_first = boxes[:8] + np.array([[900.0], [0]]) * [1, 0, 0, 0]
    batches = [
        (SIR, [batch(boxes)]),
        # Runs 8 to 11 are missing, and 12 to 15 have no partner.
        (PS, [batch(without_first), batch(boxes[8:], 12)]),
        (Configuration("SIR", "", sharp), [batch(boxes)]),
        (Configuration("PS", "21", sharp), [batch(boxes)]),
        (DPS, []),
    ]
    results = make(tmp_path / "results", batches, truth, runs=16)
    made = write_tables(results)
    expected = [f"{name}, sharpness {value}" for value in (20, 40) for name in ("SIR", "PS 21")]
    assert [made.names[index] for index in made.summaries] == expected
    found = made.differences
    assert dict(found.groupby("configuration").reference.first()) == {1: 0, 2: 0, 3: 2}
    of_ps = found[found.configuration == 1].set_index(["measure", "object"])
    difference = of_ps.loc["tracked_share"]
    assert difference.runs.tolist() == [8, 8, 8]
    tracked = np.asarray(jax.jit(measure_boxes)(boxes[:8], truth)["tracked"])
    assert difference.value["1"] == pytest.approx(-tracked[:, :, 0].mean(), rel=1e-6)
    assert difference.value["2"] == 0
    assert value(made, 0, "success", 1) > 0
    rate = of_ps.loc["success", "1"]
    wins = int(np.asarray(jax.jit(metrics.success)(boxes[:8], truth))[:, 0].sum())
    assert (rate.gained, rate.lost) == (0, wins)
    for remark in ("DPS shifts, sharpness 20: 0 of 16", "PS 21, sharpness 20: 12 of 16"):
        assert any(remark in one for one in made.remarks)
    row = rows_of(results.folder / "differences.csv")[0]
    assert (row["method"], row["reference"]) == ("PS", "SIR, sharpness 20")


def test_labels_leave_out_what_follows_from_an_appearance(tmp_path):
    plan = Plan(small_scene, methods=("sir",), grid={"appearance": ("colour", "discriminative")})
    results = prepare(plan, tmp_path).results
    names = [results.name_of(one) for one in results.configurations]
    assert names == ["SIR, appearance colour", "SIR, appearance discriminative"]
    motions = [one.parameters["motion"] for one in results.configurations]
    assert motions == ["pixels", "relative"]


@pytest.mark.usefixtures("without_scores")
def test_an_object_that_is_never_there_has_no_measures_and_fields_are_quoted(tmp_path):
    odd = Configuration("SIR", "", {**PARAMETERS, "a,b": 1.0, 'say "x"': 2.0})
    truth, boxes = walks(seed=6, runs=5, frames=6, objects=2)
    truth[:, 1] = math.nan
    made = write_tables(make(tmp_path / "results", [(odd, [batch(boxes)])], truth))
    rows = rows_of(tmp_path / "results" / "results.csv")
    absent = {(row["success"], row["frames"]) for row in rows if row["object"] == "2"}
    assert absent == {("", "0")}
    assert (float(rows[0]["a,b"]), float(rows[0]['say "x"'])) == (1.0, 2.0)
    assert math.isnan(value(made, 0, "success", 2))
    assert value(made, 0, "success") == value(made, 0, "success", 1)


def test_readers_see_the_summary(by_hand):
    table = tables.estimate_tables(by_hand[1], [0, 1])["object 4"]
    assert table.method.tolist() == ["SIR", OTHER.method]
    assert table.runs[0] == "3"
    assert table.columns[2].startswith("success at IoU 0.5"), "it leads"
    assert table.iloc[0, 2] == "50 [16, 84]"
    assert table.iloc[0, 4] == "33 [1, 91]"


def test_shown_decimals_follow_the_width_of_the_intervals():
    from jaxpf.evaluation.measures import by_name
    from jaxpf.evaluation.tables import cells_of

    measure = by_name("centre_error")
    assert cells_of(measure, np.array([[12.345, 2.1, 22.9]])) == ["12 [2, 23]"]
    assert cells_of(measure, np.array([[12.345, 12.1, 12.9]])) == ["12.3 [12.1, 12.9]"]
    texts = cells_of(measure, np.array([[-0.001, -1, 1], [math.nan] * 3]), sign="+")
    assert texts == ["+0.0 [-1.0, 1.0]", "-"]
    assert cells_of(by_name("success"), np.array([[1, math.nan, math.nan]])) == ["100.0"]
    assert cells_of(measure, np.array([[0.1 + 0.2, 0.3, 0.1 + 0.2]])) == ["0.3"]


def test_scores_of_the_benchmarks_are_means_over_runs(by_hand):
    pytest.importorskip("trackeval")
    from jaxpf.measures import tracking_scores

    runs = [tracking_scores(boxes, TRUTH) for boxes in BOXES]
    for name, middle in (("HOTA", np.mean), ("IDF1", np.mean), ("MOTA", np.median)):
        row = found(by_hand[0].folder, name, "all")
        assert row["value"] == pytest.approx(middle([run[name] for run in runs]), abs=1e-6)
    objects = {
        r["object"] for r in rows_of(by_hand[0].folder / "summary.csv") if r["measure"] == "HOTA"
    }
    assert objects == {"all"}


@pytest.mark.usefixtures("without_scores")
def test_without_trackeval_the_scores_are_left_out(tmp_path):
    results = make(tmp_path / "results", [(SIR, [batch(BOXES)])], TRUTH)
    made = write_tables(results)
    assert any("--no-deps trackeval" in remark for remark in made.remarks)
    assert "HOTA" not in (results.folder / "summary.csv").read_text()
