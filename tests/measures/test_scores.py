"""Scores in which others report: hand-worked cases, and an independent computation."""

import subprocess
import sys

import jax
import numpy as np
import pytest

from jaxpf import InputError
from jaxpf.measures import tracking_scores
from jaxpf.measures.scores import CENTRE_THRESHOLDS, IOU_THRESHOLDS, success_auc, success_curve

SHARES = ("HOTA", "DetA", "AssA", "LocA", "MOTA", "MOTP", "IDF1", "IDR", "IDP")


@pytest.fixture
def truth():
    """Two objects far apart in 10 frames."""
    boxes = np.zeros((10, 2, 4))
    boxes[..., 2:] = 10, 10
    boxes[:, 0, 0] = np.arange(10)
    boxes[:, 1, 0] = 100 - np.arange(10)
    return boxes


# CLEAR-MOT, IDF1 and HOTA


@pytest.fixture
def trackeval():
    return pytest.importorskip("trackeval", reason="TrackEval is not installed")


@pytest.mark.usefixtures("trackeval")
class TestTrackingScores:
    def test_a_perfect_tracker_has_1_everywhere(self, truth):
        truth[4:7, 1] = np.nan
        found = tracking_scores(truth, truth)
        assert {found[name] for name in SHARES} == {1.0}
        assert (found["TP"], found["FP"], found["FN"], found["IDSW"]) == (17, 0, 0, 0)
        assert found["Frag"] == 1  # TrackEval counts the absence of the object itself
        assert (found["MT"], found["PT"], found["ML"]) == (2, 0, 0)

    def test_an_overlap_of_exactly_a_half_matches(self, truth):
        found = tracking_scores(truth * [1, 1, 1, 0.5], truth)
        assert (found["MOTA"], found["IDF1"]) == (1, 1)

    def test_boxes_without_area_are_absent(self, truth):
        estimate = truth.copy()
        estimate[3:, 0, 2] = 0
        estimate[3:, 1, 0] = np.inf
        found = tracking_scores(estimate, truth)
        assert (found["TP"], found["FP"], found["FN"]) == (6, 0, 14)

    def test_identities_that_are_never_there_change_nothing(self, truth):
        found = tracking_scores(truth, truth)
        never = np.full((10, 1, 4), np.nan)
        estimate = np.concatenate([truth[:, :1], never, truth[:, 1:]], axis=1)
        assert tracking_scores(estimate, np.concatenate([never, truth], axis=1)) == found

    def test_no_estimate_is_0_and_no_truth_is_unknown(self, truth):
        nothing = np.full_like(truth, np.nan)
        found = tracking_scores(nothing, truth)
        assert (found["HOTA"], found["MOTA"], found["IDF1"]) == (0, 0, 0)
        assert np.isnan(found["LocA"])
        assert (found["FN"], found["ML"]) == (20, 2)
        found = tracking_scores(truth, nothing)
        assert all(np.isnan(found[name]) for name in SHARES)
        assert (found["TP"], found["FP"], found["FN"]) == (0, 20, 0)

    def test_the_scores_are_those_of_trackevals_own_reader(self, trackeval, tmp_path):
        """The whole way round: MOT files on disk, read and scored by TrackEval alone."""
        from jaxpf.boxes.tracks import write_mot

        random = np.random.default_rng(5)
        truth = np.cumsum(random.normal(0, 3, (40, 4, 4)) * [1, 1, 0, 0], axis=0)
        truth += random.uniform(0, 60, (4, 4)) * [1, 1, 0, 0] + [1, 1, 30, 40]
        estimate = truth[:, [0, 1, 2, 3, 0]] + random.normal(0, 4, (40, 5, 4)) * [1, 1, 0.3, 0.3]
        estimate[20:, [1, 2]] = estimate[20:, [2, 1]]
        truth[random.uniform(size=(40, 4)) < 0.1] = np.nan
        estimate[random.uniform(size=(40, 5)) < 0.2] = np.nan
        # As the files hold them.
        truth, estimate = np.round(truth, 3), np.round(estimate, 3)
        for boxes, path in (
            (truth, tmp_path / "gt" / "X-train" / "S" / "gt" / "gt.txt"),
            (estimate, tmp_path / "trackers" / "X-train" / "mine" / "data" / "S.txt"),
        ):
            path.parent.mkdir(parents=True)
            frames = np.repeat(np.arange(40), boxes.shape[1])
            write_mot(path, frames, np.tile(np.arange(boxes.shape[1]), 40), boxes.reshape(-1, 4))
        (tmp_path / "gt" / "X-train" / "S" / "seqinfo.ini").write_text("[Sequence]\nseqLength=40\n")
        dataset = trackeval.datasets.MotChallenge2DBox(
            {
                "GT_FOLDER": str(tmp_path / "gt"),
                "TRACKERS_FOLDER": str(tmp_path / "trackers"),
                "BENCHMARK": "X",
                "SEQ_INFO": {"S": 40},
                "DO_PREPROC": False,
                "PRINT_CONFIG": False,
            }
        )
        raw = dataset.get_raw_seq_data("mine", "S")
        data = dataset.get_preprocessed_seq_data(raw, "pedestrian")
        quiet = {"PRINT_CONFIG": False}
        hota = trackeval.metrics.HOTA().eval_sequence(data)
        clear = trackeval.metrics.CLEAR(quiet).eval_sequence(data)
        identity = trackeval.metrics.Identity(quiet).eval_sequence(data)
        found = tracking_scores(estimate, truth)
        for name in ("HOTA", "DetA", "AssA"):
            assert found[name] == pytest.approx(np.mean(hota[name]), abs=1e-12)
        matches = hota["HOTA_TP"] > 0
        assert found["LocA"] == pytest.approx(np.mean(hota["LocA"][matches]), abs=1e-12)
        for name in ("MOTA", "MOTP", "IDSW", "Frag", "MT", "PT", "ML"):
            assert found[name] == pytest.approx(clear[name], abs=1e-12)
        for name in ("IDF1", "IDR", "IDP"):
            assert found[name] == pytest.approx(identity[name], abs=1e-12)
        assert 0 < found["HOTA"] < 1
        assert found["IDSW"] > 2


def test_without_trackeval_the_remedy_is_named(truth, monkeypatch):
    monkeypatch.setitem(sys.modules, "trackeval", None)
    with pytest.raises(InputError, match=r"trackeval.*pip install --no-deps") as caught:
        tracking_scores(truth, truth)
    assert "\n" not in str(caught.value)
    assert np.isfinite(success_auc(truth, truth)).all()  # the curves need none


def test_only_scipy_is_needed_beside_trackeval_and_nothing_is_printed(trackeval):
    """Without OpenCV and what else TrackEval names, as after ``pip install --no-deps``."""
    code = (
        "import sys\n"
        "for name in ('cv2', 'pycocotools', 'tabulate', 'PIL'): sys.modules[name] = None\n"
        "import numpy as np\n"
        "from jaxpf.measures.scores import tracking_scores\n"
        "boxes = np.ones((3, 2, 4)) * np.arange(1, 3)[:, None]\n"
        "assert tracking_scores(boxes, boxes)['HOTA'] == 1\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


# The curves of OTB


def test_thresholds_are_the_benchmarks():
    np.testing.assert_allclose(IOU_THRESHOLDS, [0.05 * k for k in range(21)], atol=1e-15)
    np.testing.assert_array_equal(CENTRE_THRESHOLDS, range(51))


def test_curves_are_worked_out_by_hand():
    """Of an object, of one that is followed perfectly, and of one that is never there."""
    truth = np.tile([0.0, 0, 10, 10], (5, 3, 1))
    estimate = truth.copy()
    estimate[1, 0] = 0, 0, 10, 5  # IoU .5, centre 2.5 away
    estimate[2, 0] = 20, 0, 10, 10  # IoU 0, centre 20 away
    estimate[3, 0] = np.nan
    truth[4, 0] = truth[:, 2] = np.nan  # does not count
    # Overlaps 1, .5, 0 and a miss.  .5 does not exceed .5, 0 does not exceed 0, and 1 not 1.
    successes = [[0.5] * 10 + [0.25] * 10 + [0], [1] * 20 + [0], [np.nan] * 21]
    np.testing.assert_array_equal(success_curve(estimate, truth), successes)
    areas = (5 + 2.5) / 21, 20 / 21, np.nan
    np.testing.assert_allclose(success_auc(estimate, truth), areas, rtol=1e-6)


@pytest.mark.parametrize("use_x64", [False, True])
def test_curves_agree_with_counting_frame_by_frame(use_x64):
    random = np.random.default_rng(3)
    with jax.enable_x64(use_x64):
        truth = random.uniform([0, 0, 5, 5], [40, 40, 45, 45], (30, 3, 4))
        estimate = truth + random.normal(0, 8, (4, 30, 3, 4))
        truth[random.uniform(size=(30, 3)) < 0.2] = np.nan
        estimate[random.uniform(size=(4, 30, 3)) < 0.1] = np.nan
        # Whole pixels: overlaps that equal a threshold occur.
        truth, estimate = np.round(truth), np.round(estimate)
        measures = (success_curve, success_auc)
        together = jax.jit(lambda *boxes: [measure(*boxes) for measure in measures])
        found, area = map(np.asarray, together(estimate, truth))
    assert found.shape == (4, 3, 21)
    assert found.dtype == (np.float64 if use_x64 else np.float32)
    for run in range(4):
        for column in range(3):
            overlaps = []
            for t in range(30):
                gx, gy, gw, gh = truth[t, column]
                ex, ey, ew, eh = estimate[run, t, column]
                if np.isnan(gx):
                    continue
                common = max(0, min(gx + gw, ex + ew) - max(gx, ex)) * max(
                    0, min(gy + gh, ey + eh) - max(gy, ey)
                )
                is_box = np.isfinite(ex) and ew > 0 and eh > 0
                overlaps.append(common / (gw * gh + ew * eh - common) if is_box else 0)
            if jax.default_backend() == "cpu":  # a GPU's quotient may round across a threshold
                expected = [np.mean([o > k / 20 for o in overlaps]) for k in range(21)]
                np.testing.assert_allclose(found[run, column], expected, atol=1e-6)
                np.testing.assert_allclose(area[run, column], np.mean(expected), atol=1e-6)
