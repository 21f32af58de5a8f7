"""Tables of an evaluation: by hand, against the library's measures, and against SciPy."""

import csv
import errno
import io
import math
import os
import tracemalloc

import jax
import numpy as np
import pytest
from made_results import DPS, OTHER, PARAMETERS, PS, SIR, batch, imported, make, walks
from scipy import stats

from jaxpf.errors import InputError
from jaxpf.evaluation import collection, estimates, tables
from jaxpf.evaluation.collection import ErrorQuantiles
from jaxpf.evaluation.results import Configuration
from jaxpf.evaluation.tables import write_tables
from jaxpf.files.boxes import read_boxes
from jaxpf.measures import metrics
from jaxpf.measures.intervals import mean_interval, wilson_interval

NAN = [math.nan] * 4
TRUE = [0.0, 0.0, 10.0, 10.0]
HALF = [5.0, 0.0, 10.0, 10.0]  # E = G = 100, common 50, union 150, centre 5 away
FAR = [50.0, 0.0, 10.0, 10.0]
# Two frames; the second object is absent in the first of them.
TRUTH = np.array([[TRUE, NAN], [TRUE, TRUE]])
BOXES = np.array(
    [
        [[TRUE, TRUE], [HALF, TRUE]],
        [[FAR, TRUE], [TRUE, FAR]],
        [[TRUE, TRUE], [FAR, NAN]],
    ]
)


def rows_of(path):
    with open(path, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def numbers(rows, name):
    return [float(row[name]) if row[name] else math.nan for row in rows]


def found(folder, measure, identity, method="SIR", file="summary.csv"):
    """The one row of the summary about a measure of an object, as floats where it can."""
    rows = [
        row
        for row in rows_of(folder / file)
        if (row["measure"], row["object"], row["method"]) == (measure, f"{identity}", method)
    ]
    assert len(rows) == 1, (measure, identity, method)
    return {name: _float(value) for name, value in rows[0].items()}


def _float(text):
    try:
        return float(text)
    except ValueError:
        return math.nan if text == "" else text


@pytest.fixture(scope="module")
def by_hand(tmp_path_factory):
    """Three runs in two batches, and another tracker that is right but for one frame."""
    spread = np.broadcast_to([1.0, 8.0, 0.5], (2, 2, 2, 3))
    evidence = np.array([[-1000.25, -2.5], [-3, -math.inf]])
    parts = [
        batch(BOXES[:2], spread=spread, log_evidence=evidence),
        batch(BOXES[2:], first_run=2, lost=[[[True, False], [True, True]]]),
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
    assert [r["scale"] for r in rows] == 6 * ["2,4,0.5"] + 2 * [""]


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
        ("overlap", [(1 + 1 / 3) / 2, 1, 0.5, 0, 0.5, 0, 0.5, 1]),
        ("distance_precision", [1, 1, 0.5, 0, 0.5, 0, 0.5, 1]),
        # A box that is not there has no centre.
        ("located_frames", [2, 1, 2, 1, 2, 0, 2, 1]),
        ("centre_error", [2.5, 0, 25, 50, 25, math.nan, 25, 0]),
        ("uniqueness", [*6 * [0.5], math.nan, math.nan]),
        # spread over noise (2, 4, .5), in the first batch (1, 8, .5), in the second 2 throughout
        ("effective_dynamics_u", [0.5, 0.5, 0.5, 0.5, 1, 1, math.nan, math.nan]),
        ("effective_dynamics_v", [2, 2, 2, 2, 0.5, 0.5, math.nan, math.nan]),
        ("effective_dynamics_var_v", [4, 4, 4, 4, 0.25, 0.25, math.nan, math.nan]),
        ("effective_dynamics_a", [1, 1, 1, 1, 4, 4, math.nan, math.nan]),
        ("ess", [*6 * [30], math.nan, math.nan]),
        ("log_evidence", [*2 * [-1002.75], *2 * [-math.inf], *2 * [-3], math.nan, math.nan]),
        ("frames_lost", [0, 0, 0, 0, 2, 1, 0, 1]),
    ],
)
def test_measures_of_runs_by_hand(by_hand, name, expected):
    rows = rows_of(by_hand[0].folder / "results.csv")
    np.testing.assert_allclose(numbers(rows, name), expected, rtol=1e-6)


def test_summary_by_hand(by_hand):
    folder = by_hand[0].folder
    success = found(folder, "success", 4)
    wilson = wilson_interval(1, 3)
    for field, end in (("value", 0), ("lower", 2), ("upper", 3)):
        assert success[field] == pytest.approx(float(wilson[end]), rel=1e-6)
    # Tracked frames of the runs: two with a precision of .75, then one of 1 and one of 1.
    assert found(folder, "precision", 4)["value"] == pytest.approx((2 * 0.75 + 1 + 1) / 4)
    # All objects: 1, .5, 0 of their frames weigh in (2, 1).
    everything = found(folder, "overlap", "all")
    runs = [(2 * (2 / 3) + 1) / 3, (2 * 0.5 + 0) / 3, (2 * 0.5 + 0) / 3]
    assert everything["value"] == pytest.approx(np.mean(runs))
    assert everything["standard_error"] == pytest.approx(np.std(runs, ddof=1) / math.sqrt(3))
    # A run whose evidence is zero has no logarithm to average.
    assert found(folder, "log_evidence", 4)["runs"] == 2


def test_imported_tracks_have_values_without_intervals(by_hand):
    results, made = by_hand
    row = found(results.folder, "success", 9, OTHER.method)
    assert row["value"] == 1
    assert math.isnan(row["lower"])
    assert math.isnan(row["upper"])
    measures = {
        r["measure"] for r in rows_of(results.folder / "summary.csv") if r["method"] == OTHER.method
    }
    assert "uniqueness" not in measures
    assert "overlap" in measures
    assert made.summaries[1].reference is None
    assert any("imported" in remark for remark in made.remarks)


def test_pandas_reads_the_table_in_one_line(by_hand):
    pandas = pytest.importorskip("pandas")
    table = pandas.read_csv(by_hand[0].folder / "results.csv")
    assert len(table) == 8
    means = table.groupby(["method", "object"]).success.mean()
    assert means["SIR", 4] == pytest.approx(1 / 3)
    assert np.isnan(table.uniqueness[6:]).all()


@pytest.mark.parametrize("size", [7, 100, 300])
def test_summary_agrees_with_the_librarys_measures(tmp_path, size):
    truth, boxes = walks(seed=3, runs=300, frames=6, objects=2)
    truth[4:, 1] = math.nan
    boxes[7, 2, 0] = math.nan
    parts = [batch(boxes[first : first + size], first) for first in range(0, 300, size)]
    results = make(tmp_path / "results", [(SIR, parts)], truth)
    write_tables(results)
    expected = metrics.summarise(boxes, truth)
    for name, measure in (
        ("success_rate", "success"),
        ("recovery_rate", "recovered"),
        ("tracked", "tracked_share"),
        *((same, same) for same in ("precision", "recall", "precision_all", "recall_all")),
        *((same, same) for same in ("overlap", "centre_error")),
    ):
        for place, identity in enumerate((1, 2)):
            row = found(results.folder, measure, identity)
            for field in ("value", "standard_error", "lower", "upper"):
                wanted = float(getattr(expected[name], field)[place])
                assert row[field] == pytest.approx(wanted, rel=2e-5, abs=1e-7), (name, field)


def test_all_objects_together_have_the_certainty_of_runs():
    """Objects that always agree add nothing; those that are independent count each."""
    outcomes = np.arange(40) % 4 == 0
    alike = np.repeat(outcomes[:, None], 5, axis=1).astype(float)
    wilson = wilson_interval(10, 40)
    for got, wanted in zip(estimates.rate(alike)[2:4], wilson[2:], strict=True):
        assert got[-1] == pytest.approx(float(wanted), rel=1e-5)
    # Never a failure: no spread to learn from, so as if all objects were alike.
    perfect = estimates.rate(np.ones((40, 5)))
    assert perfect.lower[-1] == pytest.approx(float(wilson_interval(40, 40).lower))
    # Independent ones: close to the 200 trials that they are.
    random = np.random.default_rng(0).random((40, 5)) < 0.4
    several = estimates.rate(random.astype(float))
    pooled = wilson_interval(int(random.sum()), 200)
    width = several.upper[-1] - several.lower[-1]
    assert width == pytest.approx(float(pooled.upper - pooled.lower), rel=0.25)


@pytest.mark.statistical
def test_interval_of_the_rate_over_all_objects_covers():
    """Objects that share their luck: the interval covers, that of independent trials does not."""
    random = np.random.default_rng(1)
    runs, objects, repetitions = 50, 6, 300
    covered, naive = 0, 0
    for _ in range(repetitions):
        luck = random.beta(1.6, 0.4, (runs, 1))  # mean .8, correlation 1 / (1 + 2) within a run
        outcomes = (random.random((runs, objects)) < luck).astype(float)
        interval = estimates.rate(outcomes)
        covered += interval.lower[-1] <= 0.8 <= interval.upper[-1]
        plain = wilson_interval(outcomes.sum(), outcomes.size)
        naive += bool(plain.lower <= 0.8 <= plain.upper)
    error = math.sqrt(0.95 * 0.05 / repetitions)
    assert covered / repetitions > 0.95 - 4 * error
    assert naive / repetitions < 0.95 - 4 * error


def test_newcombes_interval_as_published():
    """Newcombe (1998), table II: 36, 12, 2 and 0 pairs of 50."""
    assert estimates.newcombe_interval(36, 12, 2, 0) == pytest.approx((0.0569, 0.3404), abs=5e-5)
    lower, upper = estimates.newcombe_interval(36, 2, 12, 0)
    assert (lower, upper) == pytest.approx((-0.3404, -0.0569), abs=5e-5)


@pytest.mark.parametrize("table", [(5, 0, 0, 5), (0, 10, 0, 0), (10, 0, 0, 0), (0, 5, 5, 0)])
def test_newcombes_interval_at_the_edges(table):
    lower, upper = estimates.newcombe_interval(*table)
    difference = (table[1] - table[2]) / 10
    assert -1 <= lower <= difference <= upper <= 1
    assert upper > lower


@pytest.mark.parametrize(("gained", "lost"), [(12, 2), (0, 5), (3, 3), (0, 0), (1, 0), (90, 60)])
def test_mcnemar_is_the_binomial_test_of_the_pairs_that_differ(gained, lost):
    total = gained + lost
    expected = stats.binomtest(gained, total).pvalue if total else 1.0
    assert estimates.mcnemar_p(gained, lost) == pytest.approx(expected, rel=1e-9)


def test_holm_by_hand():
    adjusted = estimates.holm([0.01, 0.04, math.nan, 0.03, 0.005])
    np.testing.assert_allclose(adjusted, [0.03, 0.06, math.nan, 0.06, 0.02])
    assert estimates.holm([0.9, 0.8]).tolist() == [1.0, 1.0]


def test_paired_means_are_students():
    random = np.random.default_rng(2)
    ours = random.normal(0.3, 1, (15, 1)) + random.normal(0, 3, (15, 1))
    theirs = ours + random.normal(0.4, 1, (15, 1))
    ones = np.ones_like(ours)
    difference = estimates.mean_difference(ours, ones, theirs, ones)
    test = stats.ttest_rel(ours[:, 0], theirs[:, 0])
    interval = test.confidence_interval()
    for place in (0, 1):  # the object, and all of one
        assert difference.value[place] == pytest.approx(np.mean(ours - theirs))
        assert difference.p[place] == pytest.approx(test.pvalue)
        ends = difference.lower[place], difference.upper[place]
        assert ends == pytest.approx((interval.low, interval.high))


def test_error_of_weighted_differences_is_that_of_the_weighted_mean():
    """Against a reference that is the same in every run, only our own error is left."""
    random = np.random.default_rng(3)
    values, weights = random.random((30, 2)), random.integers(0, 9, (30, 2)).astype(float)
    values[weights == 0] = math.nan
    constant = np.full((30, 2), 0.25)
    difference = estimates.mean_difference(values, weights, constant, np.ones((30, 2)))
    wanted = mean_interval(values, weights)
    np.testing.assert_allclose(difference.value[:2], np.asarray(wanted.value) - 0.25, rtol=1e-5)
    np.testing.assert_allclose(difference.standard_error[:2], wanted.standard_error, rtol=1e-5)


def test_equal_runs_do_not_differ():
    values = np.full((5, 1), 0.1)
    difference = estimates.mean_difference(values, values, values, values)
    assert difference.value.tolist() == [0, 0]
    assert difference.p.tolist() == [1, 1]
    different = estimates.mean_difference(values, values, values + 0.5, values)
    assert np.isnan(different.p).all()  # without any spread there is nothing to test by


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
    assert [s.name for s in made.summaries] == [
        *("SIR, sharpness 20", "PS 21, sharpness 20"),
        *("SIR, sharpness 40", "PS 21, sharpness 40"),
    ]
    assert [s.reference for s in made.summaries] == [None, 0, 0, 2]
    success = made.summaries[0].estimates["success"].value
    difference = made.summaries[1].differences["tracked_share"]
    assert difference.runs.tolist() == [8, 8, 8]
    tracked = np.asarray(metrics.track_state(boxes[:8], truth))
    assert difference.value[0] == pytest.approx(-tracked[:, :, 0].mean(), rel=1e-6)
    assert difference.value[1] == 0
    assert success[0] > 0
    rate = made.summaries[1].differences["success"]
    wins = int(np.asarray(metrics.success(boxes[:8], truth))[:, 0].sum())
    assert (rate.gained[0], rate.lost[0]) == (0, wins)
    assert made.hardest == 0
    assert any("DPS shifts, sharpness 20: 0 of 16" in remark for remark in made.remarks)
    assert any("PS 21, sharpness 20: 12 of 16" in remark for remark in made.remarks)
    row = rows_of(results.folder / "differences.csv")[0]
    assert (row["method"], row["reference"]) == ("PS", "SIR, sharpness 20")


def test_an_object_that_is_never_there_has_no_measures(tmp_path):
    truth, boxes = walks(seed=6, runs=4, frames=6, objects=2)
    truth[:, 1] = math.nan
    made = write_tables(make(tmp_path / "results", [(SIR, [batch(boxes)])], truth))
    rows = rows_of(tmp_path / "results" / "results.csv")
    assert {row["success"] for row in rows if row["object"] == "2"} == {""}
    assert {row["frames"] for row in rows if row["object"] == "2"} == {"0"}
    success = made.summaries[0].estimates["success"].value
    assert math.isnan(success[1])
    assert success[2] == success[0]
    assert made.hardest == 0


def test_results_without_a_finished_run(tmp_path):
    truth, _ = walks(seed=6, runs=1, frames=3, objects=2)
    results = make(tmp_path / "results", [(SIR, [])], truth, runs=9)
    made = write_tables(results)
    assert made.printed == []
    assert "0 of 9" in made.remarks[0]
    assert rows_of(results.folder / "results.csv") == []


def test_markdown_and_latex_hold_the_summary(by_hand):
    folder = by_hand[0].folder
    markdown = (folder / "summary.md").read_text()
    table = markdown.split("## object 4")[1].split("##")[0]
    lines = [line for line in table.splitlines() if line.startswith("|")]
    assert len(lines) == 4  # header, rule, two methods
    cells = [cell.strip() for cell in lines[2].strip("|").split("|")]
    assert cells[:3] == ["SIR", "3", "33 [6, 79]"]
    assert r"a\|b \<i\>\_100%$x$" in lines[3]
    latex = (folder / "summary.tex").read_text()
    assert latex.count("\\begin{table}") == latex.count("\\end{table}") >= 3
    assert r"\_100\%\$x\$" in latex
    body = "\n".join(line for line in latex.splitlines() if not line.startswith("%"))
    rows = [line for line in body.splitlines() if line.endswith(r"\\")]
    assert {line.replace(r"\&", "").count("&") for line in rows if "SIR" in line} == {7, 8}


def test_shown_decimals_follow_the_width_of_the_intervals():
    from jaxpf.evaluation.layout import cells_of
    from jaxpf.evaluation.measures import by_name

    measure = by_name("centre_error")
    assert cells_of(measure, np.array([[12.345, 2.1, 22.9]])) == ["12 [2, 23]"]
    assert cells_of(measure, np.array([[12.345, 12.1, 12.9]])) == ["12.3 [12.1, 12.9]"]
    texts = cells_of(measure, np.array([[-0.001, -1, 1], [math.nan] * 3]), sign="+")
    assert texts == ["+0.0 [-1.0, 1.0]", "-"]
    assert cells_of(by_name("success"), np.array([[1, math.nan, math.nan]])) == ["100.0"]


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


def test_scores_of_the_benchmarks_are_means_over_runs(by_hand):
    pytest.importorskip("trackeval")
    from jaxpf.measures.scores import tracking_scores

    runs = [tracking_scores(boxes, TRUTH) for boxes in BOXES]
    for name in ("HOTA", "MOTA", "IDF1", "IDSW"):
        values = [run[name] for run in runs]
        row = found(by_hand[0].folder, name, "all")
        assert row["value"] == pytest.approx(np.mean(values), abs=1e-6)
        assert row["standard_error"] == pytest.approx(
            np.std(values, ddof=1) / math.sqrt(3), abs=1e-6
        )
    objects = {
        r["object"] for r in rows_of(by_hand[0].folder / "summary.csv") if r["measure"] == "HOTA"
    }
    assert objects == {"all"}


def test_without_trackeval_the_scores_are_left_out(tmp_path, monkeypatch):
    monkeypatch.setattr(collection, "has_scores", lambda: False)
    monkeypatch.setattr(tables, "has_scores", lambda: False)
    monkeypatch.setattr("jaxpf.evaluation.summary.has_scores", lambda: False)
    results = make(tmp_path / "results", [(SIR, [batch(BOXES)])], TRUTH)
    made = write_tables(results)
    assert any("jaxpf[scores]" in remark for remark in made.remarks)
    assert "HOTA" not in (results.folder / "summary.csv").read_text()
    assert "HOTA (" not in (results.folder / "summary.md").read_text()


def test_quantiles_are_within_a_hundredth():
    random = np.random.default_rng(4)
    errors = random.lognormal(1, 1.5, (400, 3, 2))
    errors[:, 0, 0] = math.nan
    errors[5, 1, 1] = math.nan
    counted = ErrorQuantiles(3, 2)
    counted.add(errors[:150])
    counted.add(errors[150:])
    levels = (0.05, 0.25, 0.5, 0.75, 0.95)
    got = counted.quantiles(levels)
    assert np.isnan(got[:, 0, 0]).all()
    for place, values in ((0, errors[:, :, 0]), (1, errors[:, :, 1])):
        for frame in (1, 2):
            known = values[:, frame][np.isfinite(values[:, frame])]
            exact = np.quantile(known, levels, method="inverted_cdf")
            np.testing.assert_allclose(got[:, frame, place], exact, rtol=0.0101)
    pooled = errors[:, 2].reshape(-1)
    exact = np.quantile(pooled, levels, method="inverted_cdf")
    np.testing.assert_allclose(got[:, 2, 2], exact, rtol=0.0101)


def test_success_curves_are_means_over_runs(tmp_path):
    from jaxpf.measures.scores import success_curve

    truth, boxes = walks(seed=8, runs=30, frames=6, objects=2)
    results = make(tmp_path / "results", [(SIR, [batch(boxes[:20]), batch(boxes[20:], 20)])], truth)
    (summary,) = write_tables(results).summaries
    curves = jax.jit(success_curve)(np.float32(boxes), truth)
    wanted = jax.jit(mean_interval)(curves)
    np.testing.assert_allclose(summary.curve.value[:2], wanted.value, atol=1e-6)
    np.testing.assert_allclose(summary.curve.lower[:2], wanted.lower, atol=1e-5)
    np.testing.assert_allclose(summary.curve.upper[:2], wanted.upper, atol=1e-5)
    area = summary.estimates["success_area"].value[2]
    assert area == pytest.approx(float(np.mean(curves)), rel=1e-5)


def test_the_same_results_give_the_same_bytes(tmp_path):
    truth, boxes = walks(seed=9, runs=5, frames=6, objects=2)
    results = make(tmp_path / "results", [(SIR, [batch(boxes)]), (PS, [batch(boxes[::-1])])], truth)
    written = []
    for _ in range(2):
        write_tables(results)
        files = sorted(path for path in results.folder.rglob("*") if path.suffix in _TEXT)
        written.append({path.name: path.read_bytes() for path in files})
    assert written[0] == written[1]
    assert len(written[0]) >= 5 + 6 + 1


_TEXT = {".csv", ".md", ".tex", ".txt"}


def test_a_full_disk_loses_nothing(tmp_path, monkeypatch):
    truth, boxes = walks(seed=9, runs=5, frames=6, objects=2)
    results = make(tmp_path / "results", [(SIR, [batch(boxes)])], truth)
    write_tables(results)
    before = (results.folder / "results.csv").read_bytes()
    (results.folder / ".tables-of-a-killed-process").mkdir()

    def full(file):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", full)
        with pytest.raises(InputError, match=r"results\.csv.*no space left"):
            write_tables(results)
    assert (results.folder / "results.csv").read_bytes() == before
    assert not list(results.folder.glob(".*"))


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


def test_a_printed_table_fits_the_terminals_printer(by_hand, capsys):
    from jaxpf.cli.common import print_table

    for table in by_hand[1].printed:
        print_table(*table)
    text = capsys.readouterr().out
    assert "object 9" in text or "object 4" in text
    assert "33 [6, 79]" in text


def test_fields_of_the_header_are_quoted():
    line = tables._csv_line(["a,b", 'say "x"'])
    assert next(csv.reader(io.StringIO(line))) == ["a,b", 'say "x"']
