import jax
import numpy as np
import pytest

from jaxpf import measures
from jaxpf.measures import metrics, particle_sets

NOWHERE = [np.nan] * 4
TRUTH = [0.0, 0.0, 10.0, 10.0]
# Half of it lies on the truth, and covers half of the truth: E = G = 100, E and G = 50.
HALF = [5.0, 0.0, 10.0, 10.0]
# Four times as large as the truth and around it: precision 100 / 400, recall 1.
LARGE = [0.0, 0.0, 20.0, 20.0]
FAR = [50.0, 50.0, 10.0, 10.0]

measure_boxes = jax.jit(metrics.measure_boxes)


@jax.jit
def success_and_recovery(estimate, truth):
    found = metrics.measure_boxes(estimate, truth)
    both = metrics.throughout, metrics.in_the_end
    return [each(found["tracked"], found["present"])[..., 0] for each in both]


effective_sample_size = jax.jit(measures.effective_sample_size)


@pytest.mark.parametrize(
    ("estimate", "state", "precision", "recall", "iou", "error"),
    [
        (TRUTH, True, 1, 1, 1, 0),
        (HALF, True, 50 / 100, 50 / 100, 50 / 150, 5),
        (LARGE, True, 100 / 400, 100 / 100, 100 / 400, np.sqrt(5**2 + 5**2)),
        # x from 7 to 10, y from 6 to 10 of the 10 x 10: 12 of E = 5 * 8 = 40, of G = 100,
        # of the union 40 + 100 - 12; centre (9.5, 10) against (5, 5).
        ([7, 6, 5, 8], True, 12 / 40, 12 / 100, 12 / 128, np.hypot(4.5, 5)),
        (FAR, False, 0, 0, 0, np.hypot(50, 50)),
        ([10, 0, 10, 10], False, 0, 0, 0, 10),
        # Without area: a miss, yet it has a centre, (2, 5).
        ([2, 2, 0, 6], False, 0, 0, 0, 3),
        (NOWHERE, False, 0, 0, 0, np.nan),
    ],
)
def test_measures_of_a_frame_by_hand(estimate, state, precision, recall, iou, error):
    measured = measure_boxes(np.array(estimate, float), np.array(TRUTH))
    assert bool(measured["tracked"]) is state
    np.testing.assert_allclose(measured["precision"], precision, rtol=1e-6)
    np.testing.assert_allclose(measured["recall"], recall, rtol=1e-6)
    np.testing.assert_allclose(measured["iou"], iou, rtol=1e-6)
    np.testing.assert_allclose(measured["centre_error"], error, rtol=1e-6)


@pytest.mark.parametrize("truth", [NOWHERE, [0.0, 0.0, 0.0, 10.0], [0.0, 0.0, 10.0, -1.0]])
def test_a_frame_without_truth_has_no_measures(truth):
    measured = measure_boxes(np.array(TRUTH), np.array(truth))
    assert not measured.pop("present")
    assert not measured.pop("tracked")
    assert np.isnan(list(measured.values())).all()


@pytest.mark.parametrize(
    ("truth", "estimate", "succeeds", "recovers"),
    [
        (4 * [TRUTH], [TRUTH, TRUTH, HALF, LARGE], True, True),
        (4 * [TRUTH], [TRUTH, TRUTH, FAR, HALF], False, True),
        (4 * [TRUTH], [TRUTH, TRUTH, HALF, FAR], False, False),
        (4 * [TRUTH], [TRUTH, TRUTH, NOWHERE, HALF], False, True),
        # Frames without truth do not count.
        ([NOWHERE, TRUTH, TRUTH, NOWHERE], [FAR, HALF, HALF, NOWHERE], True, True),
        ([NOWHERE, TRUTH, TRUTH, NOWHERE], [FAR, HALF, FAR, TRUTH], False, False),
        ([NOWHERE, TRUTH, TRUTH, NOWHERE], [FAR, FAR, HALF, FAR], False, True),
    ],
)
def test_success_needs_every_frame_and_recovery_the_last(truth, estimate, succeeds, recovers):
    found = success_and_recovery(*(np.array(boxes)[:, None] for boxes in (estimate, truth)))
    assert found == [succeeds, recovers]


def test_an_object_that_never_has_truth_is_neither_tracked_nor_counted():
    truth = np.array([[TRUTH, NOWHERE]] * 2)
    estimate = np.broadcast_to(np.array(TRUTH), (5, 2, 2, 4))
    assert jax.jit(measures.success)(estimate, truth).tolist() == [[True, False]] * 5
    found = measures.summarise(estimate, truth)
    for name in ("success_rate", "recovery_rate"):
        np.testing.assert_array_equal(found[name].value, [1, np.nan])
        np.testing.assert_array_equal(found[name].upper, [1, np.nan])
        assert found[name].lower[0] == pytest.approx(0.025 ** (1 / 5), abs=0.02)


def test_masked_mean_leaves_out_what_is_masked_or_not_finite():
    masked_mean = jax.jit(metrics.masked_mean, static_argnums=2)
    values = np.array([[1.0, np.nan, 3.0, 100.0], [np.nan, np.inf, 5.0, 100.0]])
    mask = np.array([True, True, True, False])
    np.testing.assert_allclose(masked_mean(values, mask, -1), [2, 5])
    assert np.isnan(masked_mean(values, np.zeros(4, bool), (0, 1)))


def test_effective_dynamics_by_hand():
    effective_dynamics = jax.jit(particle_sets.effective_dynamics)
    spread = np.array([[1.0, 3.0, 0.5], [4.0, 2.0, 0.0]])
    result = effective_dynamics(spread, np.array([2.0, 2.0, 0.0]))
    np.testing.assert_allclose(result, [[0.5, 1.5, np.nan], [2, 1, np.nan]])
    per_object = effective_dynamics(spread, np.array([[1.0] * 3, [2.0] * 3]))
    np.testing.assert_allclose(per_object, [[1, 3, 0.5], [2, 1, 0]])


@pytest.mark.parametrize(
    ("weights", "expected"),
    [
        ([1, 1, 1, 1], 4),
        ([0, 0, 7, 0], 1),
        # (1 + 3)^2 / (1 + 9).
        ([1, 3], 1.6),
        ([0, 0], 0),
        ([np.nan, 2, 2], 2),
    ],
)
def test_effective_sample_size_by_hand_whatever_weights_are_multiplied_by(weights, expected):
    with np.errstate(divide="ignore"):
        log_weights = np.log(np.array(weights, np.float32))
    for shift, rtol in ((0, 1e-6), (700, 2e-3), (-1e4, 2e-3), (1e4, 2e-3)):
        found = effective_sample_size(log_weights + np.float32(shift))
        np.testing.assert_allclose(found, expected, rtol=rtol)


def test_summary_by_hand():
    # Two runs, three frames; the second object is absent in the last frame.
    truth = np.array([[TRUTH, TRUTH], [TRUTH, TRUTH], [TRUTH, NOWHERE]])
    estimate = np.array(
        [
            [[TRUTH, HALF], [HALF, HALF], [LARGE, FAR]],
            [[TRUTH, FAR], [FAR, NOWHERE], [FAR, TRUTH]],
        ]
    )
    result = measures.summarise(estimate, truth)
    expected = {
        "success_rate": [1 / 2, 1 / 2],
        "recovery_rate": [1 / 2, 1 / 2],
        "tracked": [4 / 6, 2 / 4],
        "precision": [(1 + 0.5 + 0.25 + 1) / 4, (0.5 + 0.5) / 2],
        "recall": [(1 + 0.5 + 1 + 1) / 4, (0.5 + 0.5) / 2],
        "precision_all": [(1 + 0.5 + 0.25 + 1) / 6, (0.5 + 0.5) / 4],
        "recall_all": [(1 + 0.5 + 1 + 1) / 6, (0.5 + 0.5) / 4],
        "iou": [(1 + 50 / 150 + 100 / 400 + 1) / 6, (2 * 50 / 150) / 4],
        # Distances: FAR sqrt(5000), LARGE sqrt(50), HALF 5; the NaN estimate is left out.  The
        # median of two runs is their mean.
        "centre_error": [
            ((0 + 5 + 50**0.5) / 3 + (0 + 2 * 5000**0.5) / 3) / 2,
            (5 + 5000**0.5) / 2,
        ],
    }
    assert set(result) == set(expected)
    for name, values in expected.items():
        np.testing.assert_allclose(result[name].value, values, rtol=1e-5, err_msg=name)
    # Tracked, object 2: per run 1 and 0, two frames each: error sqrt(2 * 2 * (2 * .5)^2 / 4^2).
    error = np.asarray(result["tracked"].standard_error)
    np.testing.assert_allclose(error[1], 0.5, rtol=1e-6)
