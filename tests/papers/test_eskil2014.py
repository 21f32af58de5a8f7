"""The experiment on deforming bodies: its measures, its judgements, and a small whole of it."""

import jax
import numpy as np
import pytest

import jaxpf
from jaxpf.papers import eskil2014
from jaxpf.papers.eskil2014 import calibration, claims, clips, figures, methods, tables
from jaxpf.papers.eskil2014.scenes import Outcome
from jaxpf.papers.judging.claims import CONTRADICTS, SUPPORTS

NAMES = ("nose", "eye", "dorsal front", "tail")


def made(proposed: float, pffl: float, spot: float) -> Outcome:
    """Many scenes of a fish, four points; errors grow to the given ones at the end."""
    rng = np.random.default_rng(0)
    growth = np.linspace(0, 1, 40)[:, None]

    def errors(last, runs, scenes=40):
        return last * growth * rng.uniform(0.9, 1.1, (scenes, runs, 40, 4))

    visible = np.ones((40, 40, 4), bool)
    visible[:, 2:8, 0] = False  # back for thirty frames
    found = {
        methods.PROPOSED: errors(proposed, 5),
        methods.PFFL: errors(pffl, 5),
        methods.SPOT: errors(spot, 1, scenes=2),
    }
    return Outcome("fish", NAMES, found, visible)


def test_claims_follow_the_figures():
    verdicts = [c.verdict for c in claims.scene_claims({"fish": made(0.02, 0.2, 0.03)})]
    # PFFL's error grows from the first frame on: it parts too early.
    assert verdicts.count(SUPPORTS) == 6
    assert verdicts.count(CONTRADICTS) == 1
    turned = [c.verdict for c in claims.scene_claims({"fish": made(0.2, 0.02, 0.3)})]
    assert turned.count(CONTRADICTS) >= 4


def test_speeds_are_judged():
    def verdicts(proposed, pffl, spot):
        timings = np.array([0.98, 1.0, 1.01, 1.02])
        rate = {methods.PROPOSED: proposed * timings, methods.PFFL: pffl + 0 * timings}
        rates = {"platty": rate | {methods.SPOT: spot * timings[::-1]}}
        return [claim.verdict for claim in claims.speed_claims(rates)]

    assert verdicts(100.0, 110.0, 2.0) == [SUPPORTS, SUPPORTS]
    assert verdicts(60.0, 110.0, 80.0) == [CONTRADICTS, CONTRADICTS]
    # A little faster is not considerably faster.
    assert verdicts(100.0, 110.0, 80.0) == [SUPPORTS, CONTRADICTS]


def test_a_lost_run_does_not_hide_among_the_others():
    errors = np.full((3, 5, 40, 3), 0.1) + 1e-3 * np.random.default_rng(0).random((3, 5, 40, 3))
    errors[:, 0, -5:] = 1.5  # its mean with the other four is .38, above .25
    errors[:, 1, :5] = 0.6  # but this one's would be .2
    names = ("head", "left hand", "right hand")
    found = Outcome("skydivers", names, {methods.PROPOSED: errors}, np.ones((3, 40, 3), bool))
    peak, together = claims.scene_claims({"skydivers": found})
    assert float(peak.measured.split()[1]) == pytest.approx((1.5 + 0.6 + 3 * 0.1) / 5, abs=0.02)
    assert peak.verdict == CONTRADICTS
    # Frames count in which all three are near: 190 of 200.
    assert float(together.measured.split()[1]) == pytest.approx(95)


def test_a_point_that_passes_by_is_not_found_again():
    visible = np.ones((45, 1), bool)
    visible[5:10] = False
    errors = np.full((2, 45, 1), 0.5)
    errors[0, 30:] = 0.02  # the first run's stays, the second's passes
    errors[1, 35:38] = 0.02
    np.testing.assert_array_equal(tables.found_again(errors, visible), [1, 0])
    assert np.isnan(tables.found_again(errors[:, :35], visible[:35])).all()


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


def test_blinks_are_judged_by_the_eyes_alone():
    names = ("left eye outer", "nose tip")
    rng = np.random.default_rng(0)
    errors = 0.02 + 0.001 * rng.random((40, 5, 127, 2))
    errors[..., 1] = 0.5

    def verdict(errors):
        found = {methods.PROPOSED: errors}
        face = Outcome("face", (*names, "right lip corner"), found, np.ones((40, 127, 3), bool))
        judged = claims.scene_claims({"face": face})
        return next(c.verdict for c in judged if c.statement.startswith("Three blinks"))

    errors = np.concatenate([errors, errors[..., :1]], axis=-1)
    errors[0, 0, 28, 0] = 0.3
    assert verdict(errors) == SUPPORTS
    errors[:, :, 70:, 0] = rng.uniform(0.2, 0.4, errors[:, :, 70:, 0].shape)
    errors[0, 0, 73:79, 0] = 0.02
    assert verdict(errors) == CONTRADICTS


def test_the_table_has_a_row_for_every_method():
    table = tables.scene_table(made(0.02, 0.2, 0.05))
    assert [label for label, _ in table.rows] == [methods.PROPOSED, methods.PFFL, methods.SPOT]
    kept = {label: cells[3].measured.value for label, cells in table.rows}
    assert kept[methods.PROPOSED] == 4
    assert kept[methods.PFFL] == 0
    drawn = figures.curves({"fish": made(0.02, 0.2, 0.05)})
    assert set(drawn) == {"figure_1", "figure_3", "figure_4"}


def test_a_folder_without_the_clips_is_refused(tmp_path):
    with pytest.raises(jaxpf.InputError, match="holds none of badja_bear"):
        clips.available(tmp_path)
    with pytest.raises(jaxpf.InputError, match="multiple of 5"):
        eskil2014.PAPER.run(runs=7)


def test_the_bear_starts_where_it_is_marked(data_folder):
    bear = clips.read(data_folder / "badja_bear")
    assert bear.marked[0]
    assert bear.visible[0].all()
    assert len(bear.names) + len(bear.left_out) == 20
    assert len(bear.frames) == len(bear.truth)


@pytest.mark.slow
def test_the_quick_version_runs_through():
    comparison = eskil2014.PAPER.run(runs=10, quick=True, report=lambda line: None)
    assert [table.name for table in comparison.tables] == ["errors_fish", "frames_per_second"]
    assert len(comparison.claims) >= 4
    assert all(claim.measured for claim in comparison.claims)


def test_the_calibration_starts_with_what_is_in_use_and_needs_more_than_chance():
    assert min(calibration.SEEDS) >= 2**20
    frame = np.random.default_rng(0).integers(0, 255, (80, 80, 3), np.uint8)
    points = np.array([[30.0, 30], [50, 40]])
    for method, grid in calibration.GRIDS.items():
        in_use = methods.tracker(method, frame, points, 5.0)
        start = {name: values[0] for name, values in grid.items()}
        same = methods.tracker(method, frame, points, 5.0, **start)
        for one, other in zip(jax.tree.leaves(in_use), jax.tree.leaves(same), strict=True):
            np.testing.assert_array_equal(one, other)
        assert jax.tree.structure(in_use) == jax.tree.structure(same)
    in_use = 3.0 + np.random.default_rng(1).random((3, 4))
    noise = np.tile([0.1, -0.1, 0.1, -0.1], (3, 1))
    scores = [
        calibration._judged(in_use + noise + shift, in_use)[1] for shift in (-0.5, -0.02, 0.5)
    ]
    np.testing.assert_allclose(scores, [-0.5, 0, 0.5], atol=1e-9)


def test_the_search_keeps_what_is_in_use_unless_another_is_clearly_better(monkeypatch):
    def errors(method, settings, drawn):
        asked.append(dict(settings))
        better = settings.get("velocity_memory") == 5
        return 3.0 - better + np.random.default_rng(len(asked)).normal(0, 0.1, (3, 4))

    asked = []
    monkeypatch.setattr(calibration, "SEEDS", ())
    monkeypatch.setattr(calibration, "errors", errors)
    table = calibration.calibrate(lambda line: None)
    assert "'velocity_memory': 5, 'shape_scale': 0.1" in table.note
    assert "'momentum': 0.25" in table.note
    assert len(table.rows) == sum(
        len(values) for grid in calibration.GRIDS.values() for values in grid.values()
    )
