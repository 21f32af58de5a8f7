"""The experiment on deforming bodies: its measures, its judgements, and a small whole of it."""

import numpy as np
import pytest
from judged import verdicts

from jaxpf.papers.eskil2014 import scenes as methods
from jaxpf.papers.eskil2014.study import PAPER, found_again, study_of
from jaxpf.papers.judging.claims import NOT_SEEN, SUPPORTED

pytestmark = pytest.mark.compiled_as_by_users

FISH = ("nose", "eye", "dorsal front", "tail")
FACE = ("left eye outer", "nose tip", "right lip corner")
DIVERS = ("head", "left hand", "right hand")


def measured(scene, names, errors, visible=None):
    """A study of one kind of scene; errors by method, ``[S, T, P]``."""
    if visible is None:
        visible = np.ones(errors[methods.PROPOSED].shape, bool)
    return study_of({scene: {"names": np.array([names]), "visible": visible, **errors}})


def fish(proposed: float, pffl: float):
    """Many scenes of a fish, four points; errors grow to the given ones at the end."""
    rng = np.random.default_rng(0)
    growth = np.linspace(0, 1, 40)[:, None]

    def errors(last):
        return last * growth * rng.uniform(0.9, 1.1, (50, 40, 4))

    visible = np.ones((50, 40, 4), bool)
    visible[:, 2:8, 0] = False  # back for thirty frames
    found = {methods.PROPOSED: errors(proposed), methods.PFFL: errors(pffl)}
    return measured("fish", FISH, found, visible)


def test_claims_and_the_table_follow_the_figures():
    found = verdicts(PAPER, fish(0.02, 0.2))
    assert found.pop("fish_together") == NOT_SEEN  # PFFL's error grows from the first frame on
    assert set(found.values()) == {SUPPORTED}
    assert list(verdicts(PAPER, fish(0.2, 0.02)).values()).count(NOT_SEEN) == 6
    (table,) = PAPER.tables(fish(0.02, 0.2))
    kept = {label: cells[3].measured.value for label, cells in table.rows}
    assert kept == {methods.PROPOSED: 4, methods.PFFL: 0}
    assert set(PAPER.figures(fish(0.02, 0.2))) == {"figure_3", "figure_4"}


def test_spot_is_compared_on_the_scenes_that_it_has():
    def spot_rows(scene, error):
        rng = np.random.default_rng(1)
        names = {"skydivers": DIVERS, "face": FACE}.get(scene, FISH)
        noise = rng.uniform(0.9, 1.1, (2, 50, 127, len(names)))
        found = {methods.PROPOSED: 0.02 * noise[0], methods.SPOT: error * noise[1, :25]}
        found[methods.PFFL] = found[methods.PROPOSED]
        return verdicts(PAPER, measured(scene, names, found))[f"{scene}_spot"]

    assert [spot_rows("fish", error) for error in (0.02, 0.2)] == [SUPPORTED, NOT_SEEN]
    assert [spot_rows("skydivers", error) for error in (0.02, 0.9)] == [NOT_SEEN, SUPPORTED]
    assert [spot_rows("face", error) for error in (0.01, 0.2)] == [NOT_SEEN, SUPPORTED]


def test_a_lost_scene_does_not_hide_among_the_others():
    errors = np.full((150, 100, 3), 0.1) + 1e-3 * np.random.default_rng(0).random((150, 100, 3))
    errors[:30, -5:] = 1.5  # the mean curve of all is below .4 there
    errors[30:60, :5] = 0.6  # but this one's would be .2
    found = measured("skydivers", DIVERS, {methods.PROPOSED: errors})
    figures = PAPER.quantities(found)
    (peak,), (near,) = figures["skydivers_peak"], figures["skydivers_near"]
    assert peak.value == pytest.approx((1.5 + 0.6 + 3 * 0.1) / 5, abs=0.02)
    assert verdicts(PAPER, found)["skydivers_peak"] == NOT_SEEN
    # Frames count in which all three are near: all but five of a hundred, in two scenes of five.
    assert near.value == pytest.approx(98)


def test_a_point_that_passes_by_is_not_found_again():
    visible = np.ones((45, 1), bool)
    visible[5:10] = False
    stays, passes = np.full((2, 45, 1), 0.5)
    stays[30:] = passes[35:38] = 0.02
    assert [found_again(errors, visible) for errors in (stays, passes)] == [1, 0]
    assert np.isnan(found_again(stays[:35], visible[:35]))


def test_the_printed_drift_divides_by_the_plain_sum():
    from jaxpf.filters.factored import drift

    rng = np.random.default_rng(3)
    velocities = rng.normal(size=(10, 4, 2)).astype(np.float32)
    motion = drift.Motion(np.zeros((4, 2), np.float32), velocities, np.int32(10))
    related = np.asarray(drift.correlations(motion))
    printed = np.asarray(drift.weights(motion, "literal"))
    np.testing.assert_allclose(printed, related / related.sum(axis=1, keepdims=True), rtol=1e-4)
    assert (related < 0).any()
    np.testing.assert_allclose(printed.sum(axis=1), 1, rtol=1e-4)


@pytest.mark.parametrize(
    ("name", "shape", "scale"),
    [
        (methods.PRINTED, "pixels", 0.01),
        (methods.OF_DISTANCE, "relative", 0.01),
        (methods.OF_FRAME, "pixels", 1.2),
    ],
)
def test_the_printed_scale_is_read_in_three_units(name, shape, scale):
    frame = np.random.default_rng(0).integers(0, 255, (90, 120, 3), np.uint8)
    tracker = methods.tracker_of(name, frame, np.array([[30.0, 40], [70, 50]]), 5.0)
    assert (tracker.shape, tracker.drift) == (shape, "literal")
    assert tracker.shape_scale == pytest.approx(scale)


def test_blinks_are_judged_by_the_eyes_alone():
    rng = np.random.default_rng(0)
    errors = 0.02 + 0.001 * rng.random((40, 127, 3))
    errors[..., 1] = 0.5

    def verdict(errors):
        return verdicts(PAPER, measured("face", FACE, {methods.PROPOSED: errors}))["face_blinks"]

    errors[0, 28, 0] = 0.3
    assert verdict(errors) == SUPPORTED
    errors[:, 70:, 0] = rng.uniform(0.2, 0.4, errors[:, 70:, 0].shape)
    errors[0, 73:79, 0] = 0.02
    assert verdict(errors) == NOT_SEEN


@pytest.mark.slow
def test_the_quick_version_runs_through():
    comparison = PAPER.compare(range(2), quick=True)
    assert [table.name for table in comparison.tables] == ["errors_fish", "chosen_settings"]
    assert len(comparison.claims) >= 4
    assert all(claim.figures for claim in comparison.claims)
